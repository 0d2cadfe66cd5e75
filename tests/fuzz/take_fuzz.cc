// Fuzz target: the readers of the logs and meshes of a take.
#include <sys/mman.h>
#include <unistd.h>

#include <string>

#include "base/core/error.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const int fd = memfd_create("take", MFD_CLOEXEC);
  const std::string path = "/proc/self/fd/" + std::to_string(fd);
  if (write(fd, data, size) == static_cast<ssize_t>(size)) {
    try {
      v3d::take::FrameLogReader frames(path);
      for (const v3d::FrameLabel& label : frames.labels()) frames.read(label.pulse);
      v3d::take::read_pulses(path);
    } catch (const v3d::InputError&) {
    }
    try {
      v3d::take::MeshFileReader meshes(path);
      for (const int64_t pulse : meshes.pulses()) v3d::io::value_or_throw(meshes.read(pulse));
    } catch (const v3d::InputError&) {
    }
  }
  close(fd);
  return 0;
}
