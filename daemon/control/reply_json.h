// JSON for the details of replies, and for lists of takes. The adapter of nlohmann::json.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/take_listing.h"

namespace v3d {

/// The keys of `v3dctl verify --json`: take, complete, pulses {commanded, sensed (null without a
/// sense line), unsensed [..], extra, runt [..]}, cameras [...].
std::string ledger_json(const Ledger& ledger);
/// What `v3dctl takes --json` prints and v3d-viewd serves: {"takes": [{name, studio, started_ns,
/// state, verified, rate_hz, pulses, seconds, bytes, mesh_bytes, cameras, meshes, slate {scene,
/// take, note, mark}}]}. Text that is not UTF-8 is mended. `indent` as that of nlohmann's dump().
std::string takes_json(const std::vector<TakeListing>& takes, int indent = -1);
std::string numbers_json(const std::map<std::string, double>& values);
/// The account of a reconstruction: its numbers, and where several nodes share the take, the pulses
/// without a mesh: `without_mesh` [..].
std::string recon_json(const std::map<std::string, double>& values,
                       const std::vector<int64_t>& without_mesh);

}  // namespace v3d
