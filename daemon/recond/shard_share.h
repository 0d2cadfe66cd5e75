// Whose pulse is whose, when several nodes reconstruct one take.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/bus/frame_groups.h"

namespace v3d {

/// The place in the roster of the node that makes the mesh of `pulse` (0 or more). `there`: by
/// place, which nodes live and answer for the pulse; at least one does. Each node has the pulses
/// that are its place modulo the size of the roster; those of one that is not there go round among
/// the others. So a death moves the pulses of the dead alone, evenly, and every node that knows who
/// is there knows who makes what.
size_t maker_of(int64_t pulse, const std::vector<bool>& there);

/// The frame groups, of `groups`, in which frames of the pulses of `place` travel, in a roster of
/// `nodes`. A node hears no other pulses than its own where `nodes` divides `groups`.
FrameGroupSet groups_of(size_t place, size_t nodes, size_t groups);

}  // namespace v3d
