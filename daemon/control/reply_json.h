// JSON of reply details and take lists. Confines nlohmann::json to one source file.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/take_listing.h"

namespace v3d::control {

/// A ledger with the keys of `v3dctl verify --json`: take, complete, pulses {commanded, sensed
/// (null without a sense line), unsensed [..], extra, runt [..]}, cameras [...]; for a copy without
/// all nodes, absent_nodes [{name, cameras}].
std::string ledger_json(const take::Ledger& ledger);
/// The list that `v3dctl takes --json` prints and v3d-viewd serves: {"takes": [{name, studio,
/// started_ns, state, verified, rate_hz, pulses, seconds, bytes, mesh_bytes, proxy_bytes (0 without
/// proxy.v3d), cameras, meshes, slate {scene, take, note, mark}}]}. Where the timecode is known,
/// timecode is "10:00:00:00 to 10:01:00:00", of the first and the last pulse. Where mesh.v3d cannot
/// be read, meshes is null and mesh_error has the cause; for a copy without all nodes, absent_nodes
/// is as in ledger_json(). Bytes that are not UTF-8 are replaced. `indent`: see
/// nlohmann::json::dump().
std::string takes_json(const std::vector<take::TakeListing>& takes, int indent = -1);
std::string numbers_json(const std::map<std::string, double>& values);
/// The result of a reconstruction node in a shared take: its numbers, and the pulses without a mesh
/// as `without_mesh` [..].
std::string recon_json(const std::map<std::string, double>& values,
                       const std::vector<int64_t>& without_mesh);

}  // namespace v3d::control
