#include "daemon/viewd/scene_folders.h"

#include <algorithm>
#include <array>

#include "base/name.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = "scene.json";
constexpr std::array<std::string_view, 8> kShown{".glb", ".gltf", ".bin", ".png",
                                                 ".jpg", ".jpeg", ".mp4", ".webm"};

bool has_scene(const fs::path& folder) {
  std::error_code error;
  return fs::is_regular_file(fs::symlink_status(folder / kScene, error));
}

}  // namespace

std::vector<std::string> find_scenes(const fs::path& takes) {
  std::vector<std::string> scenes;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(takes, error)) {
    const std::string name = entry.path().filename();
    if (is_file_name(name) && has_scene(entry.path())) scenes.push_back(name);
  }
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

bool is_of_scene(const fs::path& folder, const std::string& file) {
  const std::string ending = fs::path(file).extension();
  const bool shown = file == kScene || std::ranges::find(kShown, ending) != kShown.end();
  return is_file_name(file) && shown && has_scene(folder);
}

}  // namespace v3d
