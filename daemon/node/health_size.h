// Health of nodes with many cameras: at most as long as its receivers accept.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::node {

/// One line of problems, one of each camera: the first eight of them, and the number of the others.
std::string join_camera_problems(const std::vector<std::string>& problems);

/// Makes `health` at most `max_bytes` long when encoded. Takes these steps in turn, until it is
/// short enough, and adds to `health.text` what is left out:
/// 1. shortens `health.text`
/// 2. removes the texts of cameras
/// 3. removes the values of cameras except frames, missing frames and streaming
/// 4. removes all values of cameras
///
/// `max_bytes` is at least bus::kMaxUnverifiedHealth, which is enough for what is left then.
void shorten_health(wire::HealthMessage& health, size_t max_bytes);

}  // namespace v3d::node
