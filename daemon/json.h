// JSON for the details of replies. The adapter of nlohmann::json.
#pragma once

#include <map>
#include <string>

#include "take/ledger.h"

namespace v3d {

/// The keys of `v3dctl verify --json`: take, complete, pulses {commanded, sensed (null without a
/// sense line), unsensed [..], extra, runt [..]}, cameras [...].
std::string ledger_json(const Ledger& ledger);
std::string numbers_json(const std::map<std::string, double>& values);

}  // namespace v3d
