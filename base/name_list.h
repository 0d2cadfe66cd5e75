// Several names in one message.
#pragma once

#include <string>
#include <vector>

namespace v3d {

/// "cam00, cam01, ..." cut after two dozen.
std::string join_names(const std::vector<std::string>& names);

}  // namespace v3d
