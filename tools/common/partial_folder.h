// A new folder that appears under its name when it is complete.
#pragma once

#include <cstdint>
#include <filesystem>

namespace v3d {

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
