// The take that record_driver records, and what the tests know of it.
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
/// Of one run of the driver; a restart in the take records as many more.
inline constexpr int64_t kDrivenPulses = 6;

/// Its studio, in a folder: takes/, background/, calib.toml, studio.toml.
inline Studio driven_studio(const std::filesystem::path& folder) {
  Studio studio;
  studio.name = "dojo";
  studio.path = folder / "studio.toml";
  studio.storage = {.takes = folder / "takes",
                    .background = folder / "background",
                    .calib = folder / "calib.toml"};
  return studio;
}

/// Files and folders that a studio has before the first take.
void make_driven_studio(const std::filesystem::path& folder);
/// What was copied into the take when it began and is not as in the studio, one line each. The take
/// may lie in the quarantine.
std::vector<std::string> missing_of_begun_take(const std::filesystem::path& folder);

}  // namespace v3d::test
