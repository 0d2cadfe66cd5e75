// A new file that gets its name when it is complete.
#pragma once

#include <filesystem>

namespace v3d {

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

}  // namespace v3d
