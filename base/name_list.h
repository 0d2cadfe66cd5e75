// Formats a list of names for a message.
#pragma once

#include <string>
#include <vector>

namespace v3d {

/// "cam00, cam01, ...": the first 24 names; "..." replaces the others.
std::string join_names(const std::vector<std::string>& names);

}  // namespace v3d
