// New files and folders that get their names when they are complete.
#pragma once

#include <cstdint>
#include <filesystem>

namespace v3d {

// A new file that gets its name when it is complete.

/// File with a hidden temporary name beside its final one, for other programs that write it. The
/// destructor removes it unless finish() was called. One thread.
class PartialFile {
 public:
  /// `file`: the final name. Throws InputError when it is a folder, or a recorded file of a take
  /// (base/io/recorded_file.h). Creates nothing.
  explicit PartialFile(const std::filesystem::path& file);
  ~PartialFile();
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  /// Where the content is written: a name with the same extension.
  const std::filesystem::path& path() const { return path_; }
  /// Gives the file its final name, in place of an existing file, and waits until both are on the
  /// disk. Throws std::runtime_error with path and cause; then the existing file stays.
  void finish();

 private:
  std::filesystem::path file_, path_;
  bool finished_ = false;
};

// A new folder that appears under its name when it is complete.

/// The absolute path of a folder, without "." and "..", and without a slash at its end. Its last
/// part is the name of the folder, also for "take/" and ".".
std::filesystem::path normal_folder(const std::filesystem::path& folder);

/// Folder with a temporary name beside its final one. The destructor removes it unless finish() was
/// called. One thread.
class PartialFolder {
 public:
  enum class Existing : uint8_t {
    kReject,   ///< only an empty folder may have the final name
    kReplace,  ///< finish() removes a folder of the final name, with all that it holds
  };
  /// Makes `folder`.partial-XXXXXX. Throws InputError when `folder` exists and may not be replaced,
  /// or when the new folder cannot be made, for instance without the parent of `folder`.
  explicit PartialFolder(const std::filesystem::path& folder,
                         Existing existing = Existing::kReject);
  ~PartialFolder();
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  /// Where the content is written.
  const std::filesystem::path& path() const { return path_; }
  /// The name after finish(): absolute, without a slash at its end.
  const std::filesystem::path& final_path() const { return folder_; }
  /// Renames the folder to its final name, and waits until the name is on the disk. A folder that
  /// it replaces has its name until then. Throws std::runtime_error with path and cause, also when
  /// the final name is taken by now and may not be replaced.
  void finish();

 private:
  std::filesystem::path folder_, path_;
  Existing existing_;
  bool finished_ = false;
};

}  // namespace v3d
