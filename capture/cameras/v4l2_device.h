// What a V4L2 camera asks of the kernel, as a seam: tests play the kernel.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// An open /dev/videoN. One thread. Closing it unmaps what was mapped.
class V4l2Device {
 public:
  virtual ~V4l2Device() = default;
  /// ioctl(2), repeated when a signal came between: 0, or the errno.
  virtual int control(unsigned long request, void* argument) = 0;
  /// Waits until a buffer can be taken or something went wrong with the device; false when neither
  /// happened until `deadline`.
  virtual bool wait(MonotonicInstant deadline) = 0;
  /// A buffer of the driver in our memory; empty when it cannot be mapped.
  virtual std::span<const uint8_t> map(size_t bytes, uint32_t offset) = 0;
};

/// Opens a device file; null, with errno set, when that fails.
using V4l2Opener = std::function<std::unique_ptr<V4l2Device>(const std::string& path)>;
std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path);

}  // namespace v3d
