// Whether every PC of the studio has the studio key, and this one a valid member list.
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

/// The authority's signature is on it. Requires a studio with a member list.
Finding check_member_list(const Studio& studio);

/// `health`: of the nodes that were heard; what carries a MAC of the key here has the same key.
std::vector<Finding> check_keys_of(const std::vector<std::string>& nodes,
                                   const std::map<std::string, HealthMessage>& health);

/// All of them; listens for up to two seconds. Of nodes that are not heard it says so.
std::vector<Finding> examine_keys(const Studio& studio);

}  // namespace v3d::ctl
