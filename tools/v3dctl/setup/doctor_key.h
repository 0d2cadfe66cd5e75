// Whether every PC of the studio has the studio key.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "v3dctl/setup/doctor.h"
#include "wire/messages.h"

namespace v3d::ctl {

/// It is there, nobody else may read it, and it holds a key.
Finding check_key_file(const std::filesystem::path& key);

/// `health`: of the nodes that were heard; what carries the seal of the key here has the same key.
std::vector<Finding> check_keys_of(const std::vector<std::string>& nodes,
                                   const std::map<std::string, HealthMessage>& health);

/// Both; listens for up to two seconds. Of nodes that are not heard it says so.
std::vector<Finding> examine_keys(const Studio& studio);

}  // namespace v3d::ctl
