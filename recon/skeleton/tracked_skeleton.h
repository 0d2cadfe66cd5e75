// Skeleton of a tracked surface: joints are where rigid parts meet.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/skeleton/kinematic_structure.h"
#include "recon/skeleton/rigid_parts.h"
#include "recon/skeleton/skin.h"

namespace v3d::recon {

/// Learns joints and bone lengths from tracked surfaces: at their pulses the joints of `structure`
/// become the centres of rotation between rigid parts (rigid_parts()), and rotations become those
/// of the parts. Pulses that had no skeleton get one. At other pulses, bones get the new lengths.
/// `numbers`: the pulse of each evidence of the structure, ascending. A pulse of two bodies has the
/// skeleton of the later one. A body without a pulse that has a skeleton is left out, with an empty
/// skin. Returns the skin of each body. Works in the caller's TBB arena; deterministic.
///
/// Sources: Ehrig, Taylor, Duda and Heller, A survey of formal methods for determining the centre
/// of rotation of ball joints, Journal of Biomechanics 39, 2006 (symmetrical centre of rotation
/// estimation).
std::vector<Skin> learn_from_tracked(std::span<const TrackedBody> bodies,
                                     std::span<const int64_t> numbers,
                                     KinematicStructure& structure);

}  // namespace v3d::recon
