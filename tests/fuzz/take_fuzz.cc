// Fuzz target: the readers of the logs and meshes of a take.
#include <fcntl.h>
#include <unistd.h>

#include <string>

#include "base/core/error.h"
#include "fuzz_input.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "tests/support/temporary_folder.h"
#include "tests/take/recording.h"

namespace {

using v3d::test::must;

/// A file that holds the input. It has a name in a folder, because the readers of a take follow no
/// symbolic link, as /proc/self/fd/N is one. Nothing else is in the folder: the reader of a log
/// also reads the other segments and their indexes.
class InputFile {
 public:
  InputFile() : folder_("/dev/shm"), path_((folder_ / "take.lcmlog").string()) {
    v3d::test::remove_leftovers("/dev/shm");
    check_reader();
    fd_ = open(path_.c_str(), O_RDWR | O_CLOEXEC);
    must(fd_ >= 0);
  }
  ~InputFile() { close(fd_); }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& path() const { return path_; }
  void write(const uint8_t* data, size_t size) const {
    must(ftruncate(fd_, 0) == 0);
    must(pwrite(fd_, data, size, 0) == static_cast<ssize_t>(size));
  }

 private:
  /// Checks that a reader finds an event in the file. If it rejected the path, it would read no
  /// input, and the target would still report no findings.
  void check_reader() const {
    {
      v3d::take::EventLogWriter log(path_);
      must(log.write(v3d::test::recorded_frame("cam01", 0, {2, 2})).has_value());
    }
    must(v3d::take::FrameLogReader(path_).labels().size() == 1);
  }

  const v3d::test::TemporaryFolder folder_;
  const std::string path_;
  int fd_ = -1;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const InputFile file;
  file.write(data, size);
  try {
    v3d::take::FrameLogReader frames(file.path());
    for (const v3d::FrameLabel& label : frames.labels()) frames.read(label.pulse);
    v3d::take::read_pulses(file.path());
  } catch (const v3d::InputError&) {
  }
  try {
    v3d::take::MeshFileReader meshes(file.path());
    for (const int64_t pulse : meshes.pulses()) v3d::io::value_or_throw(meshes.read(pulse));
  } catch (const v3d::InputError&) {
  }
  return 0;
}
