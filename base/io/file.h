// Files, and results of operations on them.
#pragma once

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

#include "base/io/unique_fd.h"

namespace v3d {

// Reads and writes whole files in set-up code and commands: like the functions of v3d::io below,
// but with exceptions.

/// True when `path` names a file of any kind; symbolic links are followed. Throws InputError with
/// path and cause when this cannot be determined: no permission, a loop of links, a disk error.
bool file_exists(const std::filesystem::path& path);

/// Like io::read_file(). Throws InputError with path and cause.
std::string read_file(const std::filesystem::path& path);

/// Maximum length of a text file of a take, bytes. A ledger may be longer (kMaxLedgerBytes,
/// take/ledger/ledger.h).
inline constexpr uint64_t kMaxTakeTextBytes = 8 << 20;
/// Reads a whole text file of a take (take.toml, calib.toml, ...).
/// Throws InputError with path and cause when it is not a regular file, is a symbolic link, or is
/// longer than kMaxTakeTextBytes. The path of its folder may contain symbolic links: operators move
/// takes to other disks.
std::string read_take_text(const std::filesystem::path& path);

/// Like io::replace_file(), for results of commands and set-up files. Throws InputError when `path`
/// is a recorded file (base/io/recorded_file.h), and std::runtime_error with path and cause when it
/// cannot be written. Code that owns a file of a take uses io::replace_file().
void replace_file(const std::filesystem::path& path, std::string_view text);

}  // namespace v3d

namespace v3d::io {

// Result of an operation that may fail while the program runs: a value or an IoError.
//
// Set-up code converts an IoError to an exception (value_or_throw, throw_if_failed); daemons handle
// it as data.

/// Cause of a failed operation.
struct IoError {
  int code = 0;  ///< errno
  /// One line with path and cause: "cannot write /a/b: No space left on device".
  std::string message;
};

template <class T>
using Result = tl::expected<T, IoError>;
using Status = Result<void>;

/// The error of the last failed system call: "cannot `action` `path`: <text of errno>".
/// Reads errno, so call it directly after the failure.
tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path);
/// The same for a failure without errno: "cannot `action` `path`: `cause`".
tl::unexpected<IoError> io_error(std::string_view action, const std::filesystem::path& path,
                                 std::string_view cause, int code = EINVAL);

/// For set-up that reads: throws InputError (exit status 2) with the message.
[[noreturn]] void throw_input_error(const IoError& error);
template <class T>
T value_or_throw(Result<T> result) {
  if (!result) throw_input_error(result.error());
  return *std::move(result);
}

/// For commands that write: throws std::runtime_error (exit status 1) with the message.
void throw_if_failed(const Status& status);

// File: a regular file that is read and written by position. Every failure is a value with path and
// cause. End of file, short counts and EINTR are distinct results.

enum class OpenMode : uint8_t {
  kRead,              ///< an existing regular file
  kReadWithinFolder,  ///< an existing regular file; fails with ELOOP where it is a symbolic link
  kCreate,            ///< a new file for writing; fails with EEXIST when the name is taken
  kCreatePrivate,     ///< like kCreate; only the owner may read it
  kWriteExisting,     ///< an existing regular file for writing, no symbolic link; keeps its content
};

/// Safe for concurrent read() calls; use from one thread at a time for writes.
class File {
 public:
  /// Never blocks: rejects FIFOs and devices ("it is not a regular file").
  [[nodiscard]] static Result<File> open(std::filesystem::path path, OpenMode mode);

  const std::filesystem::path& path() const { return path_; }
  int fd() const { return fd_.get(); }

  /// Current length in bytes.
  [[nodiscard]] Result<uint64_t> size() const;
  /// Reads into `bytes` from `offset`. The count is less than bytes.size() only at the end of the
  /// file.
  [[nodiscard]] Result<size_t> read(uint64_t offset, std::span<uint8_t> bytes) const;
  /// Fills `bytes` from `offset`. The bytes were inside the file when it was opened, so the end of
  /// the file is an error, too (EIO): another program shortened the file.
  [[nodiscard]] Status read_whole(uint64_t offset, std::span<uint8_t> bytes) const;
  /// Writes the concatenated parts (4 at most) at `offset`. After a failure, some of the bytes may
  /// be in the file.
  [[nodiscard]] Status write(uint64_t offset,
                             std::initializer_list<std::span<const uint8_t>> parts);
  /// Waits until data and length are on the disk (fsync).
  [[nodiscard]] Status sync() const;

 private:
  File(std::filesystem::path path, UniqueFd fd) : path_(std::move(path)), fd_(std::move(fd)) {}

  std::filesystem::path path_;
  UniqueFd fd_;
};

/// Waits until the entries of a folder are on the disk. Use it after files were created, renamed or
/// removed.
[[nodiscard]] Status sync_folder(const std::filesystem::path& folder);

/// Waits until all data written to the file system of `folder`, also by other programs, are on the
/// disk (syncfs). Fails with path and cause.
[[nodiscard]] Status sync_file_system(const std::filesystem::path& folder);

inline constexpr uint64_t kMaxTextBytes = 1 << 30;
/// Reads a whole regular file. Fails when it is longer than `max_bytes`. `mode`: a mode for
/// reading.
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& path,
                                            uint64_t max_bytes = kMaxTextBytes,
                                            OpenMode mode = OpenMode::kRead);

/// Replaces a file atomically: readers see the old content or the new, never a part.
/// After success the new content survives a power cut (temporary file with a unique name, fsync,
/// rename, fsync of the folder). After a failure the file has its old content. Exception: when only
/// the last step failed, it has the new content, which may not survive a power cut.
/// Concurrent calls for one path are safe; the last rename wins.
[[nodiscard]] Status replace_file(const std::filesystem::path& path, std::string_view content);

/// Copies a regular file atomically, like replace_file(). Its data are on the disk on return; its
/// name is only after sync_folder().
[[nodiscard]] Status copy_file(const std::filesystem::path& from, const std::filesystem::path& to);

/// True for the name of a temporary file of these two, such as "take.toml.part-123-1". It may
/// vanish at any time; a power cut leaves it.
bool is_temporary(const std::filesystem::path& path);

/// The kind of file at `path`, symbolic links followed; file_type::not_found when there is none.
/// Unlike std::filesystem::exists(path, error), it reports other errors as errors.
[[nodiscard]] Result<std::filesystem::file_type> type_of(const std::filesystem::path& path);
/// The same without following a symbolic link: file_type::symlink.
[[nodiscard]] Result<std::filesystem::file_type> entry_type_of(const std::filesystem::path& path);

/// The entries of a folder, sorted by name.
[[nodiscard]] Result<std::vector<std::filesystem::path>> list_folder(
    const std::filesystem::path& folder);

/// Bytes of the file system of `folder` that are free for this user.
[[nodiscard]] Result<uint64_t> free_bytes(const std::filesystem::path& folder);

/// Creates a folder and its missing parents, and waits until their names are on the disk.
[[nodiscard]] Status create_folders(const std::filesystem::path& folder);

/// Renames a file or folder and waits until the change is on the disk. Fails with EEXIST when `to`
/// exists.
[[nodiscard]] Status rename_new(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace v3d::io
