#include "daemon/viewd/served_files.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "take/logs/log_files.h"

namespace v3d::viewd {

namespace fs = std::filesystem;

std::string content_type(const fs::path& path) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 15> kTypes = {
      {{".html", "text/html; charset=utf-8"},
       {".js", "text/javascript; charset=utf-8"},
       {".css", "text/css; charset=utf-8"},
       {".wasm", "application/wasm"},
       {".json", "application/json"},
       {".svg", "image/svg+xml"},
       {".png", "image/png"},
       {".jpg", "image/jpeg"},
       {".jpeg", "image/jpeg"},
       {".glb", "model/gltf-binary"},
       {".mp4", "video/mp4"},
       {".webm", "video/webm"},
       {".wav", "audio/wav"},
       {".woff2", "font/woff2"},
       {".toml", "text/plain; charset=utf-8"}}};
  const std::string extension = path.extension();
  for (const auto& [known, type] : kTypes) {
    if (extension == known) return std::string(type);
  }
  return "application/octet-stream";
}

std::map<std::string, PageFile> find_page_files(const fs::path& folder) {
  std::map<std::string, PageFile> files;
  std::error_code error;
  for (const auto& entry : fs::recursive_directory_iterator(folder, error)) {
    if (!entry.is_regular_file() || entry.is_symlink()) continue;
    const std::string url = "/" + entry.path().lexically_relative(folder).generic_string();
    files[url] = {entry.path(), content_type(entry.path())};
  }
  const auto index = files.find("/index.html");
  if (index == files.end()) {
    throw InputError("viewer.page: " + folder.string() +
                     ": has no index.html; expected the folder of the built page");
  }
  files["/"] = index->second;
  return files;
}

namespace {

constexpr const char* kScene = "scene.json";
constexpr std::array<std::string_view, 8> kShown{".glb", ".gltf", ".bin", ".png",
                                                 ".jpg", ".jpeg", ".mp4", ".webm"};

io::Result<bool> has_scene(const fs::path& folder) {
  return io::entry_type_of(folder / kScene).map([](fs::file_type type) {
    return type == fs::file_type::regular;
  });
}

}  // namespace

std::vector<std::string> find_scenes(const fs::path& takes) {
  std::vector<std::string> scenes;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(takes, error)) {
    const std::string name = entry.path().filename();
    if (is_file_name(name) && has_scene(entry.path()).value_or(false)) scenes.push_back(name);
  }
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

bool is_of_scene(const fs::path& folder, const std::string& file) {
  const std::string ending = fs::path(file).extension();
  const bool shown = file == kScene || std::ranges::find(kShown, ending) != kShown.end();
  return is_file_name(file) && shown && io::value_or_throw(has_scene(folder));
}

std::vector<int> find_skeletons(const fs::path& folder) {
  constexpr int kMaxPerformer = 255;
  throw_if_unreadable(folder);
  std::vector<int> performers;
  if (stamp_of(folder / "skeleton.json")) performers.push_back(1);
  for (int performer = 2; performer <= kMaxPerformer; ++performer) {
    const std::string file = "skeleton.performer" + std::to_string(performer) + ".json";
    if (stamp_of(folder / file)) performers.push_back(performer);
  }
  return performers;
}

FileStamp stamp_of(const struct stat& state) {
  return {.inode = state.st_ino,
          .size = state.st_size,
          .changed_ns = state.st_mtim.tv_sec * 1'000'000'000LL + state.st_mtim.tv_nsec};
}

std::optional<FileStamp> stamp_of(const std::filesystem::path& path) {
  struct stat state {};
  if (lstat(path.c_str(), &state) != 0 || !S_ISREG(state.st_mode)) return {};
  return stamp_of(state);
}

std::optional<FileStamp> stamp_of_log(const std::filesystem::path& log) {
  std::optional<FileStamp> sum;
  const auto segments = take::existing_segments(log);
  if (!segments) return {};
  for (const std::filesystem::path& path : *segments) {
    const auto segment = stamp_of(path);
    if (!segment) return {};
    if (!sum) {
      sum = segment;
      continue;
    }
    sum->size += segment->size;
    sum->changed_ns = std::max(sum->changed_ns, segment->changed_ns);
  }
  return sum;
}

void throw_if_unreadable(const fs::path& folder) {
  const auto entries = io::list_folder(folder);
  if (entries || entries.error().code == ENOENT || entries.error().code == ENOTDIR) return;
  io::throw_input_error(entries.error());
}

std::string tag_of(const FileStamp& stamp) {
  return "\"" + std::to_string(stamp.size) + "-" + std::to_string(stamp.changed_ns) + "\"";
}

}  // namespace v3d::viewd
