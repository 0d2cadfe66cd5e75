#include "recorded_take.h"

#include "support/temporary_folder.h"

namespace v3d::test {

void make_driven_studio(const std::filesystem::path& folder) {
  const Studio studio = driven_studio(folder);
  std::filesystem::create_directories(studio.storage.takes);
  std::filesystem::create_directories(studio.storage.background);
  write_text(studio.path, "name = 'dojo'\n");
  write_text(studio.storage.calib, "[metadata]\n");
  for (const std::string& camera : kDrivenCameras) {
    write_text(studio.storage.background / (camera + ".mean.png"), std::string(6000, 'm'));
    write_text(studio.storage.background / (camera + ".spread.png"), std::string(300, 's'));
    write_text(studio.storage.background / (camera + ".toml"), "# plates\n");
  }
}

}  // namespace v3d::test
