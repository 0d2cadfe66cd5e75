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

/// The MIME type for the extension of `path`; "application/octet-stream" if it is unknown.
std::string content_type(const std::filesystem::path& path);

/// All regular files in the folder and below, by URL path: "/assets/a.js", and "/" for index.html.
/// The page is served from this table, which is made at start: no path of a request reaches the
/// disk. Throws InputError if there is no index.html.
std::map<std::string, PageFile> find_page_files(const std::filesystem::path& folder);

}  // namespace v3d
