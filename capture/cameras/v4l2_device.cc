#include "capture/cameras/v4l2_device.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <vector>

namespace v3d {
namespace {

class KernelDevice : public V4l2Device {
 public:
  explicit KernelDevice(int fd) : fd_(fd) {}
  ~KernelDevice() override {
    for (const Mapping& m : mappings_) munmap(m.data, m.bytes);
    close(fd_);
  }
  KernelDevice(const KernelDevice&) = delete;
  KernelDevice& operator=(const KernelDevice&) = delete;

  int control(unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ioctl(fd_, request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }

  bool wait(MonotonicInstant deadline) override {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Monotonic::now());
    pollfd device{.fd = fd_, .events = POLLIN, .revents = 0};
    return poll(&device, 1, static_cast<int>(std::max<int64_t>(left.count(), 0))) > 0;
  }

  std::span<const uint8_t> map(size_t bytes, uint32_t offset) override {
    void* data = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, offset);
    if (data == MAP_FAILED) return {};
    mappings_.push_back({data, bytes});
    return {static_cast<const uint8_t*>(data), bytes};
  }

 private:
  struct Mapping {
    void* data;
    size_t bytes;
  };
  const int fd_;
  std::vector<Mapping> mappings_;
};

}  // namespace

std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path) {
  const int fd = open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  return fd < 0 ? nullptr : std::make_unique<KernelDevice>(fd);
}

}  // namespace v3d
