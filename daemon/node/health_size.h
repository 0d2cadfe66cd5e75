// Health of nodes with many cameras: at most as long as its receivers accept.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::node {

/// One line of problems, one of each camera: the first eight of them, and the number of the others.
std::string join_camera_problems(const std::vector<std::string>& problems);

/// Shortens `health` until it has at most `max_bytes` when encoded. In this order, and only as far
/// as necessary: `health.text`; the texts of cameras; their values, except frames, missing frames
/// and whether they stream; all their values. `health.text` then says what is left out.
///
/// What is left has at most 16 KiB: the values of a node do not become more with its cameras.
void shorten_health(wire::HealthMessage& health, size_t max_bytes);

}  // namespace v3d::node
