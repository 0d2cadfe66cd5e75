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
