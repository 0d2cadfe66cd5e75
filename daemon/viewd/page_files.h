// The files of the viewer's page.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace v3d {

struct PageFile {
  std::filesystem::path path;
  std::string type;  ///< "text/html; charset=utf-8"
};

/// "application/wasm" by the file's extension; "application/octet-stream" where it is unknown.
std::string content_type(const std::filesystem::path& path);

/// All regular files in the folder and below, by what stands in a URL: "/assets/a.js", and "/" for
/// index.html. What is not in here when the daemon begins is not there: no path of a request is
/// ever looked up on the disk. Throws InputError when there is no index.html.
std::map<std::string, PageFile> find_page_files(const std::filesystem::path& folder);

}  // namespace v3d
