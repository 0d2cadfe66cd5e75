// File: a regular file that is read and written by position. Every failure is a value with path and
// cause; end of file, short counts and EINTR are never mistaken for one another.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/io/result.h"
#include "base/io/unique_fd.h"

namespace v3d::io {

enum class OpenMode : uint8_t {
  kRead,              ///< an existing regular file
  kReadWithinFolder,  ///< an existing regular file; fails with ELOOP where it is a symbolic link
  kCreate,            ///< a new file for writing; fails with EEXIST when the name is taken
  kWriteExisting,     ///< an existing regular file for writing, no symbolic link; keeps its content
};

/// One thread at a time for writes; read() is safe from several threads.
class File {
 public:
  /// Never blocks: a FIFO or a device is refused ("is not a regular file").
  [[nodiscard]] static Result<File> open(std::filesystem::path path, OpenMode mode);

  const std::filesystem::path& path() const { return path_; }
  int fd() const { return fd_.get(); }

  /// Length in bytes, now.
  [[nodiscard]] Result<uint64_t> size() const;
  /// Fills `bytes` from `offset`. The count is less than asked for only at the end of the file.
  [[nodiscard]] Result<size_t> read(uint64_t offset, std::span<uint8_t> bytes) const;
  /// Writes the parts one behind the other from `offset`. After a failure some of the bytes may be
  /// in the file.
  [[nodiscard]] Status write(uint64_t offset,
                             std::initializer_list<std::span<const uint8_t>> parts);
  /// Waits until the disk has data and length (fsync).
  [[nodiscard]] Status sync() const;

 private:
  File(std::filesystem::path path, UniqueFd fd) : path_(std::move(path)), fd_(std::move(fd)) {}

  std::filesystem::path path_;
  UniqueFd fd_;
};

/// Waits until the disk has the names in a folder: after files were created, renamed or removed.
[[nodiscard]] Status sync_folder(const std::filesystem::path& folder);

/// Waits until the disk has everything that was written to the file system of `folder`, by other
/// programs, too (syncfs). Fails with path and cause.
[[nodiscard]] Status sync_file_system(const std::filesystem::path& folder);

inline constexpr uint64_t kMaxTextBytes = 1 << 30;
/// A whole regular file. Fails when it is longer than `max_bytes`. `mode`: how to open it, for
/// reading.
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& path,
                                            uint64_t max_bytes = kMaxTextBytes,
                                            OpenMode mode = OpenMode::kRead);

/// Replaces a file in one step: readers see the old content or the new, never a part. After
/// success the new content survives a power cut (temporary file with a unique name, fsync, rename,
/// fsync of the folder). After a failure the old content stands, or, when only the last step
/// failed, the new one that may not survive a power cut. Concurrent calls for one path are safe;
/// the last rename wins.
[[nodiscard]] Status replace_file(const std::filesystem::path& path, std::string_view content);

/// Copies a regular file in one step, as replace_file() writes one; its data are on the disk, its
/// name is not before sync_folder().
[[nodiscard]] Status copy_file(const std::filesystem::path& from, const std::filesystem::path& to);

/// The kind of file at `path`, symbolic links followed; file_type::not_found where there is none.
/// An error, unlike std::filesystem::exists(path, error), is never mistaken for "there is none".
[[nodiscard]] Result<std::filesystem::file_type> type_of(const std::filesystem::path& path);

/// The entries of a folder, sorted by name.
[[nodiscard]] Result<std::vector<std::filesystem::path>> list_folder(
    const std::filesystem::path& folder);

/// Makes a folder and its missing parents, and waits until the disk has their names.
[[nodiscard]] Status create_folders(const std::filesystem::path& folder);

/// Renames a file or folder and waits until the disk has it. Fails with EEXIST when `to` exists.
[[nodiscard]] Status rename_new(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace v3d::io
