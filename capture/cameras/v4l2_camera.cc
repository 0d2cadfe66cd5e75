#include "capture/cameras/v4l2_camera.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "base/config/v4l2_address.h"
#include "base/core/error.h"
#include "base/io/unique_fd.h"

namespace v3d::capture {
namespace {

constexpr uint32_t kCapture = V4L2_BUF_TYPE_VIDEO_CAPTURE;
/// Flags of a time stamp: its clock, and the place in the frame where it is taken.
constexpr uint32_t kStamp = V4L2_BUF_FLAG_TIMESTAMP_MASK | V4L2_BUF_FLAG_TSTAMP_SRC_MASK;
}  // namespace

class V4l2Camera::Stream {
 public:
  Stream(const StudioCamera& settings, std::optional<double> rate_hz,
         std::unique_ptr<V4l2Device> device)
      : settings_(settings), device_(std::move(device)) {
    applied_ = v4l2::write_settings(settings_, rate_hz, *device_);
    v4l2_requestbuffers request{};
    request.count = static_cast<uint32_t>(settings.buffers);
    request.type = kCapture;
    request.memory = V4L2_MEMORY_MMAP;
    control_or_throw("buffers", VIDIOC_REQBUFS, &request);
    for (uint32_t i = 0; i < request.count; ++i) add_buffer(i);
    if (buffers_.size() < 2) {
      v4l2::fail(settings_, "buffers", "2", std::to_string(buffers_.size()));
    }
    uint32_t type = kCapture;
    control_or_throw("stream", VIDIOC_STREAMON, &type);
  }

  ~Stream() {
    uint32_t type = kCapture;
    device_->control(VIDIOC_STREAMOFF, &type);  // error ignored: a removed device has stopped
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  ImageSize size() const { return applied_.layout.size; }
  const std::string& device() const { return applied_.device; }
  std::optional<double> trigger_rate_hz() const { return applied_.trigger_rate_hz; }
  const std::vector<SettingDifference>& differences() const { return applied_.differences; }
  bool wait(MonotonicInstant deadline) { return device_->wait(deadline); }

  /// Takes a filled buffer from the driver. Returns 0 or an errno.
  int dequeue(v4l2_buffer& buffer) {
    buffer = {};
    buffer.type = kCapture;
    buffer.memory = V4L2_MEMORY_MMAP;
    const int error = device_->control(VIDIOC_DQBUF, &buffer);
    return error == 0 && buffer.index >= buffers_.size() ? EINVAL : error;
  }
  int enqueue(v4l2_buffer& buffer) { return device_->control(VIDIOC_QBUF, &buffer); }

  /// The time stamp is of the same clock, and taken at the same place in the frame, as the driver
  /// reported at the start.
  bool has_expected_stamp(const v4l2_buffer& buffer) const {
    return (buffer.flags & kStamp) == stamp_;
  }

  /// The image in a complete buffer. Empty if the buffer is too short or damaged, or the driver
  /// marks it as erroneous.
  std::optional<Image> image(const v4l2_buffer& buffer) const {
    const std::span<const uint8_t> bytes = buffers_[buffer.index];
    const bool is_erroneous = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
    if (is_erroneous || buffer.bytesused > bytes.size()) return {};
    return decode_image(applied_.layout, bytes.first(buffer.bytesused));
  }

 private:
  void control_or_throw(const std::string& what, unsigned long request, void* argument) const {
    v4l2::control_or_throw(settings_, *device_, what, request, argument);
  }

  void add_buffer(uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = kCapture;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    control_or_throw("buffers", VIDIOC_QUERYBUF, &buffer);
    if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) {
      v4l2::fail(settings_, "time stamps", "CLOCK_MONOTONIC", "another clock");
    }
    stamp_ = buffer.flags & kStamp;
    const auto memory = device_->map(buffer.length, buffer.m.offset);
    if (memory.empty()) v4l2::fail(settings_, "buffers", "memory", std::strerror(errno));
    buffers_.push_back(memory);
    control_or_throw("buffers", VIDIOC_QBUF, &buffer);
  }

  const StudioCamera& settings_;
  const std::unique_ptr<V4l2Device> device_;
  v4l2::Applied applied_;
  uint32_t stamp_ = 0;  ///< flags
  std::vector<std::span<const uint8_t>> buffers_;
};

V4l2Camera::V4l2Camera(StudioCamera settings, V4l2Opener open)
    : settings_(std::move(settings)), open_(std::move(open)) {}
V4l2Camera::~V4l2Camera() = default;

void V4l2Camera::start() {
  stop();
  lost_ = false;
  counter_.reset();
  const std::string path = v4l2_device(settings_);
  auto device = open_(path);
  if (!device) throw InputError("camera " + settings_.name + ": " + errno_message(path));
  stream_ = std::make_unique<Stream>(settings_, rate_hz_, std::move(device));
  size_ = stream_->size();
}

void V4l2Camera::stop() { stream_.reset(); }

std::optional<CameraFrame> V4l2Camera::wait(MonotonicInstant deadline) {
  while (stream_ && !lost_ && stream_->wait(deadline)) {
    v4l2_buffer buffer{};
    const int error = stream_->dequeue(buffer);
    if (error == EAGAIN) continue;
    if (error != 0) {  // ENODEV: the device was removed; EIO: the driver stopped the stream
      lost_ = true;
      return {};
    }
    if (!stream_->has_expected_stamp(buffer)) {
      lost_ = true;
      ++damaged_;
      return {};
    }
    CameraFrame frame;
    frame.received = Monotonic::now();
    frame.device_time = DeviceInstant(std::chrono::seconds(buffer.timestamp.tv_sec) +
                                      std::chrono::microseconds(buffer.timestamp.tv_usec));
    // The 32-bit sequence number wraps. Frames are never out of order by half of its range.
    const auto before = static_cast<uint32_t>(counter_.value_or(buffer.sequence));
    counter_ = counter_.value_or(buffer.sequence) +
               static_cast<uint64_t>(int64_t{static_cast<int32_t>(buffer.sequence - before)});
    frame.counter = *counter_;
    auto image = stream_->image(buffer);
    // If the driver does not take the buffer back, it would run out of buffers.
    if (stream_->enqueue(buffer) != 0) lost_ = true;
    if (image) {
      ++completed_;
      frame.image = std::move(*image);
      return frame;
    }
    ++damaged_;
  }
  return {};
}

bool V4l2Camera::keeps_up_with(Duration period) const {
  const std::optional<double> rate = stream_ ? stream_->trigger_rate_hz() : std::nullopt;
  return !rate || v4l2::is_fast_enough(*rate, 1 / to_seconds(period));
}

CameraDevice V4l2Camera::device() const {
  return {stream_ ? stream_->device() : std::string(), {}};
}

std::vector<SettingDifference> V4l2Camera::differences() const {
  return stream_ ? stream_->differences() : std::vector<SettingDifference>();
}

CameraStatistics V4l2Camera::statistics() const {
  return {.completed = completed_, .damaged = damaged_};
}

namespace {

class KernelDevice : public V4l2Device {
 public:
  explicit KernelDevice(io::UniqueFd fd) : fd_(std::move(fd)) {}
  ~KernelDevice() override {
    for (const Mapping& m : mappings_) munmap(m.data, m.bytes);
  }
  KernelDevice(const KernelDevice&) = delete;
  KernelDevice& operator=(const KernelDevice&) = delete;

  int control(unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ioctl(fd_.get(), request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }

  bool wait(MonotonicInstant deadline) override {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Monotonic::now());
    pollfd device{.fd = fd_.get(), .events = POLLIN, .revents = 0};
    return poll(&device, 1, static_cast<int>(std::max<int64_t>(left.count(), 0))) > 0;
  }

  std::span<const uint8_t> map(size_t bytes, uint32_t offset) override {
    void* data = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(), offset);
    if (data == MAP_FAILED) return {};
    mappings_.push_back({data, bytes});
    return {static_cast<const uint8_t*>(data), bytes};
  }

 private:
  struct Mapping {
    void* data;
    size_t bytes;
  };
  const io::UniqueFd fd_;
  std::vector<Mapping> mappings_;
};

}  // namespace

std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path) {
  io::UniqueFd fd(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  return fd ? std::make_unique<KernelDevice>(std::move(fd)) : nullptr;
}

}  // namespace v3d::capture
