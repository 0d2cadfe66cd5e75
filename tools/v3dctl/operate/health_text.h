// Health as people read it. Pure.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::ctl {

/// A value with the unit that its name ends in: "812 GB" of disk_free_bytes, "45 min" of
/// disk_seconds_left, "yes" of streaming_flag, "+12 us", "25.0/s"; a count where it names none.
std::string value_text(const std::string& name, double value);

/// 45 s, 12 min, 3.5 h, 2 d: as long as it is about.
std::string duration_text(double seconds);

/// Every value of every node, the cameras in a table below it. Nodes in the order of `nodes`; those
/// that are not in `health` are silent.
std::vector<std::string> health_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, HealthMessage>& health);

}  // namespace v3d::ctl
