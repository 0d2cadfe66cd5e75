// Checks of keys: the studio key of every PC of the studio, and the member list of this PC.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "v3dctl/setup/doctor.h"
#include "wire/messages.h"

namespace v3d::ctl {

/// Finding: the file exists, contains a key, and other users cannot read it.
Finding check_key_file(const std::filesystem::path& key);

/// Finding: the member list has a valid signature of the authority. Requires a studio with a member
/// list.
Finding check_member_list(const Studio& studio);

/// One finding for each node. `health`: verified and unverified health messages by node. A node
/// whose message has a valid MAC has the studio key of this PC. A node without an entry is unknown.
std::vector<Finding> check_keys_of(const std::vector<std::string>& nodes,
                                   const std::map<std::string, HealthMessage>& health);

/// All findings of this file. Receives health for up to three seconds. Never throws for a node
/// without health messages: its finding is kUnknown.
std::vector<Finding> examine_keys(const Studio& studio);

}  // namespace v3d::ctl
