#include "recorded_take.h"

#include "base/io/file.h"
#include "base/io/whole_file.h"
#include "support/temporary_folder.h"
#include "take/take.h"
#include "take/take_removal.h"

namespace v3d::test {
namespace {

constexpr char kStudio[] = R"(name = "dojo"
[[node]]
name = "cap01"
[[node]]
name = "recon01"
[[camera]]
name = "cam01"
node = "cap01"
address = "127.0.0.11"
[[camera]]
name = "cam02"
node = "cap01"
address = "127.0.0.12"
[trigger]
node = "cap01"
kind = "simulated"
wire = "trigger.sock"
[space]
min = [-1.5, -1.5, 0]
max = [1.5, 1.5, 2]
[network]
lcm_url = "udpm://239.255.76.67:7667?ttl=0"
[storage]
takes = "takes"
background = "background"
calib = "calib.toml"
[reconstruction]
node = "recon01"
)";

}  // namespace

void make_driven_studio(const std::filesystem::path& folder) {
  const Studio studio = driven_studio(folder);
  std::filesystem::create_directories(studio.storage.takes);
  std::filesystem::create_directories(studio.storage.background);
  write_text(studio.path, kStudio);
  write_text(studio.storage.calib, "[metadata]\n");
  for (const std::string& camera : kDrivenCameras) {
    write_text(studio.storage.background / (camera + ".mean.png"), std::string(6000, 'm'));
    write_text(studio.storage.background / (camera + ".spread.png"), std::string(300, 's'));
    write_text(studio.storage.background / (camera + ".toml"), "# plates\n");
  }
}

std::vector<std::string> missing_studio_copies(const std::filesystem::path& folder) {
  const Studio studio = driven_studio(folder);
  TakePaths take{studio.storage.takes / kDrivenTake};
  if (!std::filesystem::exists(take.folder)) {
    take.folder = studio.storage.takes / kQuarantineFolder / kDrivenTake;
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
