// The take that record_driver records: names, sizes and studio files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "take/recording.h"

namespace v3d::test {

inline const std::string kDrivenTake = "kendo-07";
inline const std::string kDrivenNode = "cap01";
inline const std::vector<std::string> kDrivenCameras = {"cam01", "cam02"};
inline constexpr ImageSize kDrivenSize{64, 48};
/// Frames of the operation "record_large": 192 pages each, 4.7 MB of each camera, so that the logs
/// also request writeback while they are written.
inline constexpr ImageSize kLargeSize{1024, 768};
/// Pulses of one run of the driver. A restart in the take records as many again.
inline constexpr int64_t kDrivenPulses = 6;

/// The studio of the take in `folder`: takes/, background/, calib.toml, studio.toml.
inline Studio driven_studio(const std::filesystem::path& folder) {
  Studio studio;
  studio.name = "dojo";
  studio.path = folder / "studio.toml";
  studio.storage = {.takes = folder / "takes",
                    .background = folder / "background",
                    .calib = folder / "calib.toml"};
  return studio;
}

/// The meshes of the operations "mesh" and "mesh_restart": 500 to 60,500 bytes, 1 to 15 pages.
inline constexpr int64_t kDrivenMeshes = 12;
inline std::vector<uint8_t> driven_mesh(int64_t pulse) {
  std::vector<uint8_t> mesh(static_cast<size_t>(500 + pulse * pulse * 9973 % 60'000));
  for (size_t i = 0; i < mesh.size(); ++i)
    mesh[i] = static_cast<uint8_t>(7 * i + 31 * static_cast<size_t>(pulse));
  return mesh;
}

inline constexpr int64_t kDrivenSerial = 7;  ///< of the operation "serial"
/// The file of the serial number of the accepted member list.
inline std::filesystem::path member_serial_file(const Studio& studio) {
  return studio.storage.takes / (".member-list-" + kDrivenNode);
}

/// Writes the files and folders that a studio has before its first take.
void make_driven_studio(const std::filesystem::path& folder);
/// Compares the studio's files with their copies in the take, which may lie in the quarantine.
/// Returns missing or different copies, one line each.
std::vector<std::string> missing_studio_copies(const std::filesystem::path& folder);

}  // namespace v3d::test
