#include "daemon/viewd/page_files.h"

#include <array>
#include <utility>

#include "base/error.h"

namespace v3d {

namespace fs = std::filesystem;

std::string content_type(const fs::path& path) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 14> kTypes = {
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

}  // namespace v3d
