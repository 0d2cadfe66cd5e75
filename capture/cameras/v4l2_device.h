// Interface to a V4L2 device file. Tests replace the kernel through it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// An open device file /dev/videoN. Not thread-safe. The destructor closes it and unmaps all
/// buffers.
class V4l2Device {
 public:
  virtual ~V4l2Device() = default;
  /// Calls ioctl(2), again after EINTR. Returns 0 or an errno.
  virtual int control(unsigned long request, void* argument) = 0;
  /// Waits until a buffer is available or the device reports an error. False if neither happened
  /// before `deadline`.
  virtual bool wait(MonotonicInstant deadline) = 0;
  /// Maps a buffer of the driver (mmap). Empty, with errno set, on failure.
  virtual std::span<const uint8_t> map(size_t bytes, uint32_t offset) = 0;
};

/// Opens a device file. Null, with errno set, on failure.
using V4l2Opener = std::function<std::unique_ptr<V4l2Device>(const std::string& path)>;
std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path);

}  // namespace v3d
