#include "recorded_take.h"

#include "base/io/file.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/take.h"
#include "take/take_removal.h"

namespace v3d::test {

void make_driven_studio(const std::filesystem::path& folder) {
  const Studio studio = driven_studio(folder);
  std::filesystem::create_directories(studio.storage.takes);
  std::filesystem::create_directories(studio.storage.background);
  write_text(studio.path,
             studio_text({{kDrivenNode, {kDrivenCameras.begin(), kDrivenCameras.end()}}}));
  write_text(studio.storage.calib, "[metadata]\n");
  for (const std::string& camera : kDrivenCameras) {
    write_text(studio.storage.background / (camera + ".mean.png"), std::string(6000, 'm'));
    write_text(studio.storage.background / (camera + ".spread.png"), std::string(300, 's'));
    write_text(studio.storage.background / (camera + ".toml"), "# plates\n");
  }
}

std::vector<std::string> missing_studio_copies(const std::filesystem::path& folder) {
  const Studio studio = driven_studio(folder);
  take::TakePaths take{studio.storage.takes / kDrivenTake};
  if (!std::filesystem::exists(take.folder)) {
    take.folder = studio.storage.takes / take::kQuarantineFolder / kDrivenTake;
  }
  std::vector<std::string> missing;
  const auto expect_copy = [&](const std::filesystem::path& of, const std::filesystem::path& as) {
    const auto copy = io::read_file(as);
    if (!copy || *copy != read_file(of)) missing.push_back("missing or changed: " + as.string());
  };
  expect_copy(studio.storage.calib, take.calib());
  expect_copy(studio.path, take.folder / "studio.toml");
  for (const std::string& camera : kDrivenCameras) {
    for (const char* plate : {".mean.png", ".spread.png", ".toml"}) {
      expect_copy(studio.storage.background / (camera + plate),
                  take.folder / "background" / (camera + plate));
    }
  }
  return missing;
}

}  // namespace v3d::test
