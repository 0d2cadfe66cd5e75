#include "take/take_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <span>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "take/logs/file_hashes.h"
#include "take/logs/repaired_pulses.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

TakeFile file_of(const std::string& name, const struct stat& status) {
  return {.name = name,
          .bytes = status.st_size,
          .changed_ns = status.st_mtim.tv_sec * 1'000'000'000LL + status.st_mtim.tv_nsec,
          .checksum = {}};
}

/// Appends the names of the regular files in `folder`, each with `prefix` in front: those that are
/// UTF-8, or the others.
io::Status add_names(const fs::path& folder, const std::string& prefix, bool are_utf8,
                     std::vector<std::string>& names) {
  const auto entries = io::list_folder(folder);
  if (!entries) return tl::make_unexpected(entries.error());
  for (const fs::path& entry : *entries) {
    const std::string name = entry.filename();
    if (name.starts_with(".") || io::is_temporary(entry) || is_utf8(name) != are_utf8) continue;
    const auto type = io::type_of(entry);
    if (!type) return tl::make_unexpected(type.error());
    // A dangling link is listed, so that the attempt to read it reports the cause.
    const bool is_file = *type == fs::file_type::regular || *type == fs::file_type::not_found;
    if (is_file) names.push_back(prefix + name);
  }
  return {};
}

/// Appends the names in the take folder and in its folders background and sound.
io::Status add_all_names(const TakePaths& paths, bool are_utf8, std::vector<std::string>& names) {
  io::Status listed = add_names(paths.folder, "", are_utf8, names);
  for (const fs::path& folder : {paths.background(), paths.sound()}) {
    const auto type = io::type_of(folder);
    if (!type) return tl::make_unexpected(type.error());
    if (listed && *type == fs::file_type::directory) {
      listed = add_names(folder, folder.filename().string() + "/", are_utf8, names);
    }
  }
  return listed;
}

/// The names of the folders in `folder`, without symbolic links to folders.
io::Result<std::vector<std::string>> folders_in(const fs::path& folder) {
  const auto entries = io::list_folder(folder);
  if (!entries) return tl::make_unexpected(entries.error());
  std::vector<std::string> folders;
  for (const fs::path& entry : *entries) {
    const auto type = io::entry_type_of(entry);
    if (!type) return tl::make_unexpected(type.error());
    if (*type == fs::file_type::directory) folders.push_back(entry.filename());
  }
  return folders;
}

/// Writes dirty pages of `file` to disk, then drops its cached pages. Ignores EINVAL and EROFS of
/// fdatasync(): file systems without dirty pages and read-only mounts need no sync.
io::Status drop_from_page_cache(const io::File& file) {
  if (io::uninterrupted([&] { return fdatasync(file.fd()); }) != 0 && errno != EINVAL &&
      errno != EROFS) {
    return io::io_error("sync", file.path());
  }
  if (const int error = posix_fadvise(file.fd(), 0, 0, POSIX_FADV_DONTNEED); error != 0) {
    errno = error;
    return io::io_error("drop from the page cache", file.path());
  }
  return {};
}

}  // namespace

std::string checksum_text(uint64_t checksum) {
  std::string text(16, '0');
  for (auto digit = text.rbegin(); digit != text.rend(); ++digit, checksum >>= 4) {
    *digit = "0123456789abcdef"[checksum & 15];
  }
  return text;
}

std::optional<uint64_t> parse_checksum(std::string_view text) {
  uint64_t checksum = 0;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, checksum, 16);
  if (text.size() != 16 || parsed.ec != std::errc() || parsed.ptr != end) return std::nullopt;
  return checksum;
}

io::Result<std::vector<std::string>> take_file_names(const TakePaths& paths) {
  std::vector<std::string> names;
  const io::Status listed = add_all_names(paths, true, names);
  if (!listed) return tl::make_unexpected(listed.error());
  std::ranges::sort(names);
  return names;
}

io::Result<std::vector<std::string>> foreign_entries(const TakePaths& paths) {
  const std::string background = paths.background().filename(), sound = paths.sound().filename();
  const auto folders = folders_in(paths.folder);
  if (!folders) return folders;
  std::vector<std::string> foreign;
  for (const std::string& folder : *folders) {
    if (folder.starts_with(".shards-")) continue;  // of v3dctl reconstruct and track
    if (folder != background && folder != sound) {
      foreign.push_back(folder + "/");
      continue;
    }
    const auto inner = folders_in(paths.folder / folder);
    if (!inner) return inner;
    for (const std::string& name : *inner) foreign.push_back(folder + "/" + name + "/");
  }
  const io::Status listed = add_all_names(paths, false, foreign);
  if (!listed) return tl::make_unexpected(listed.error());
  std::ranges::sort(foreign);
  return foreign;
}

bool is_signature(std::string_view name) {
  return name.starts_with("signature.") && name.ends_with(".toml") &&
         name.size() > std::string_view("signature..toml").size();
}

bool is_part_of_take(std::string_view name) {
  const TakePaths paths;
  return name.ends_with(".lcmlog") || name == paths.calib() || name == paths.studio() ||
         name.starts_with(paths.background().string() + "/") ||
         name.starts_with(paths.sound().string() + "/");
}

bool is_skeleton(std::string_view name) {
  return name.starts_with("skeleton.") && name.ends_with(".json");
}

bool is_earlier_motion(std::string_view name) {
  return name.starts_with("motion.earlier-") && name.ends_with(".v3d");
}

bool is_written_after_ledger(std::string_view name) {
  const TakePaths paths;
  return name.ends_with(".lcmlog.index") || is_signature(name) || is_repaired_pulses(name) ||
         is_skeleton(name) || is_earlier_motion(name) ||
         std::ranges::any_of(std::array{paths.ledger(), paths.verified(), paths.slate(),
                                        paths.mesh(), paths.proxy(), paths.motion()},
                             [&](const fs::path& path) { return path == name; });
}

io::Result<TakeFile> stat_take_file(const TakePaths& paths, const std::string& name) {
  struct stat status {};
  const fs::path path = paths.folder / name;
  if (stat(path.c_str(), &status) != 0) return io::io_error("read", path);
  return file_of(name, status);
}

io::Result<TakeFile> read_take_file(const TakePaths& paths, const std::string& name, ReadFrom from,
                                    const ReadProgress& progress) {
  const auto file = io::File::open(paths.folder / name, io::OpenMode::kReadWithinFolder);
  if (!file) return tl::make_unexpected(file.error());
  struct stat status {};
  if (fstat(file->fd(), &status) != 0) return io::io_error("read", file->path());
  if (from == ReadFrom::kDisk) {
    if (auto dropped = drop_from_page_cache(*file); !dropped) {
      return tl::make_unexpected(dropped.error());
    }
  }
  TakeFile read = file_of(name, status);
  RunningChecksum sum;
  const io::Status added =
      add_to_checksum(*file, {.begin = 0, .end = static_cast<uint64_t>(read.bytes)}, sum, progress);
  if (!added) return tl::make_unexpected(added.error());
  read.checksum = sum.value();
  return read;
}

namespace {

constexpr std::string_view kKey = "xxh3";

std::string checksum_line(std::string_view content) {
  const std::span bytes(reinterpret_cast<const uint8_t*>(content.data()), content.size());
  return TomlWriter().text(kKey, checksum_text(checksum({bytes}))).written();
}

bool has_checksum_line(std::string_view text) {
  return text.starts_with(std::string(kKey) + " = ");
}

}  // namespace

bool has_right_checksum(std::string_view text) {
  if (!has_checksum_line(text)) return false;
  const size_t line = std::min(text.find('\n'), text.size() - 1) + 1;
  return text.substr(0, line) == checksum_line(text.substr(line));
}

std::string with_checksum(std::string_view content) {
  return checksum_line(content) + std::string(content);
}

TomlTable parse_checksummed(std::string_view text, const std::filesystem::path& path) {
  const bool has_checksum = has_checksum_line(text);
  if (has_checksum && !has_right_checksum(text)) {
    throw InputError(path.string() +
                     ": damaged: the checksum in its first line is not that of the other lines");
  }
  TomlTable table = TomlTable::parse(text, path);
  if (has_checksum) table.text(kKey);  // else an unknown field
  return table;
}

}  // namespace v3d::take
