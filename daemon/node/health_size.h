// Health of nodes with many cameras: at most as long as its receivers accept.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::node {

/// One line of problems, one of each camera: the first eight of them, and the number of the others.
std::string join_camera_problems(const std::vector<std::string>& problems);

/// Shortens `health` to at most `max_bytes` when encoded, and names in `health.text` what was
/// removed. Performs these steps in order, and stops after the first one that suffices:
/// 1. shortens `health.text`
/// 2. removes the texts of cameras
/// 3. removes the values of cameras except frames, missing frames and streaming
/// 4. removes all values of cameras
///
/// Requires `max_bytes` of at least bus::kMaxUnverifiedHealth: the result of step 4 is shorter.
void shorten_health(wire::HealthMessage& health, size_t max_bytes);

}  // namespace v3d::node
