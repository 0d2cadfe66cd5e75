// Retargeting: an action shown by another performer.
#pragma once

#include <cstddef>

#include "recon/editing/clip.h"

namespace v3d::recon {

/// Shows the action of `clip` by the performer of another clip: its surface in frame `shown` is
/// posed by the rotations of the action, with the bones that it has there. Positions of the pelvis
/// are scaled by the ratio of the lengths of the legs, from the point of the floor (z = 0) below
/// the first one, so that steps fit the legs. A prop is that of the other performer. The clip gets
/// the surface and the colours of that one frame. Requires a clip with a frame, and `shown` in
/// `performer`.
///
/// Source: Gleicher, Retargetting motion to new characters, SIGGRAPH 1998, for the problem; here
/// rotations are copied, and contacts are left to hold_feet().
void swap_performer(Clip& clip, const Clip& performer, size_t shown);

}  // namespace v3d::recon
