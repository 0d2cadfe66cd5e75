// The files that v3d-viewd serves: those of the page, of scenes (docs/scene.md), and their ETags.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::viewd {

/// A file of the viewer page.
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

/// Names of the folders in `takes` that contain a scene, ascending; empty if `takes` is unreadable.
std::vector<std::string> find_scenes(const std::filesystem::path& takes);

/// Is `file` in `folder` the scene, or a model, image or video by its extension? False for a folder
/// without a scene. Throws InputError if it is unknown whether the scene exists.
bool is_of_scene(const std::filesystem::path& folder, const std::string& file);

/// The performers of which the take in `folder` has a skeleton, ascending: 1 for skeleton.json, K
/// from 2 to 255 for skeleton.performerK.json. Empty if there is no such folder. Throws InputError
/// if it cannot be read.
std::vector<int> find_skeletons(const std::filesystem::path& folder);

/// Identity of the content of a file, for caches and ETags.
struct FileStamp {
  uint64_t inode = 0;
  int64_t size = 0;        ///< bytes
  int64_t changed_ns = 0;  ///< modification time, by the file system's clock
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

FileStamp stamp_of(const struct stat& state);
/// The stamp of a regular file; empty for anything else, links included.
std::optional<FileStamp> stamp_of(const std::filesystem::path& path);
/// The stamp of all segments of an event log: inode of the first, total size, latest modification.
/// Empty if there is none, or if one is not a regular file.
std::optional<FileStamp> stamp_of_log(const std::filesystem::path& log);

/// Throws InputError with path and cause if the folder cannot be read, as when the disk has failed
/// or no descriptor is free: then it is unknown what it contains. A missing folder is known to be
/// empty.
void throw_if_unreadable(const std::filesystem::path& folder);

/// The ETag of HTTP, with quotation marks.
std::string tag_of(const FileStamp& stamp);

}  // namespace v3d::viewd
