#include "capture/cameras/v4l2_camera.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/image/image.h"

namespace v3d::capture {
namespace {

constexpr uint32_t kCapture = V4L2_BUF_TYPE_VIDEO_CAPTURE;
constexpr double kExposureStepUs = 100;  ///< the unit of V4L2_CID_EXPOSURE_ABSOLUTE
/// Flags of a time stamp: its clock, and the place in the frame where it is taken.
constexpr uint32_t kStamp = V4L2_BUF_FLAG_TIMESTAMP_MASK | V4L2_BUF_FLAG_TSTAMP_SRC_MASK;
/// Relative error of a frame rate. It distinguishes 29.97 Hz from 30 Hz.
constexpr double kRateTolerance = 2e-4;

std::string text_of(uint32_t fourcc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) text += static_cast<char>(fourcc >> shift & 0x7f);
  return text;
}

std::string hexadecimal(uint32_t id) { return fmt::format("0x{:08x}", id); }

std::string number(double value) { return fmt::format("{:.6g}", value); }

/// Writes settings to the camera and reads them back.
class Setup {
 public:
  Setup(const StudioCamera& settings, std::optional<double> free_rate_hz, V4l2Device& device)
      : settings_(settings), free_rate_hz_(free_rate_hz), device_(device) {}

  /// Writes all settings. Returns the format that the camera then has.
  v4l2_pix_format all() const {
    capabilities();
    const v4l2_pix_format format = image_format();
    exposure();
    if (settings_.trigger_control) {
      trigger(*settings_.trigger_control);
    } else {
      rate(free_rate_hz_.value_or(0));
    }
    return format;
  }

  [[noreturn]] void refuse(const std::string& what, const std::string& wanted,
                           const std::string& got) const {
    throw InputError("camera " + settings_.name + ": " + what + ": wanted " + wanted + ", got " +
                     got);
  }

  void ask(const std::string& what, unsigned long request, void* argument) const {
    const int error = device_.control(request, argument);
    if (error != 0) refuse(what, "an answer", std::strerror(error));
  }

 private:
  void capabilities() const {
    v4l2_capability caps{};
    ask(settings_.address, VIDIOC_QUERYCAP, &caps);
    const uint32_t has =
        (caps.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? caps.device_caps : caps.capabilities;
    if ((has & V4L2_CAP_VIDEO_CAPTURE) == 0 || (has & V4L2_CAP_STREAMING) == 0) {
      refuse(settings_.address, "a device that streams images", "another kind of device");
    }
  }

  v4l2_pix_format image_format() const {
    v4l2_format format{};
    format.type = kCapture;
    ask("image format", VIDIOC_G_FMT, &format);
    // The parentheses select the function instead of the kernel's macro.
    const uint32_t fourcc = (v4l2_fourcc)(settings_.pixel_format);
    const ImageSize size = settings_.size.value_or(
        ImageSize{static_cast<int>(format.fmt.pix.width), static_cast<int>(format.fmt.pix.height)});
    format.fmt.pix = {};
    format.fmt.pix.width = static_cast<uint32_t>(size.width);
    format.fmt.pix.height = static_cast<uint32_t>(size.height);
    format.fmt.pix.pixelformat = fourcc;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    ask("image format", VIDIOC_S_FMT, &format);
    ask("image format", VIDIOC_G_FMT, &format);
    const v4l2_pix_format& got = format.fmt.pix;
    if (got.pixelformat != fourcc) {
      refuse("pixel_format", std::string(name(settings_.pixel_format)),
             text_of(got.pixelformat) + "; it has " + formats());
    }
    const ImageSize got_size{static_cast<int>(got.width), static_cast<int>(got.height)};
    if (got_size != size) refuse("size", format_size(size), format_size(got_size));
    const size_t row = byte_count({size.width, 1}, settings_.pixel_format);
    if (size.width > kMaxImageSide || size.height > kMaxImageSide || got.bytesperline < row) {
      refuse("image format", format_size(size), std::to_string(got.bytesperline) + " bytes a row");
    }
    return got;
  }

  std::string formats() const {
    std::string list;
    v4l2_fmtdesc format{};
    format.type = kCapture;
    while (device_.control(VIDIOC_ENUM_FMT, &format) == 0 && format.index < 256) {
      list += (list.empty() ? "" : ", ") + text_of(format.pixelformat);
      ++format.index;
    }
    return list.empty() ? "none" : list;
  }

  bool supports(uint32_t id) const {
    v4l2_queryctrl query{};
    query.id = id;
    return device_.control(VIDIOC_QUERYCTRL, &query) == 0 &&
           (query.flags & V4L2_CTRL_FLAG_DISABLED) == 0;
  }

  void control(const std::string& what, uint32_t id, int32_t wanted, int32_t tolerance = 0) const {
    v4l2_control value{.id = id, .value = wanted};
    const int setting = device_.control(VIDIOC_S_CTRL, &value);
    if (setting != 0) refuse(what, std::to_string(wanted), std::strerror(setting));
    value = {.id = id, .value = 0};
    ask(what, VIDIOC_G_CTRL, &value);
    if (std::abs(int64_t{value.value} - wanted) > tolerance) {
      refuse(what, std::to_string(wanted), std::to_string(value.value));
    }
  }

  void trigger(uint32_t id) const {
    control("trigger_control " + hexadecimal(id), id, settings_.trigger_value);
  }

  /// Sets the frame rate of a free-running camera, Hz.
  void rate(double hz) const {
    v4l2_streamparm parameters{};
    parameters.type = kCapture;
    ask("rate", VIDIOC_G_PARM, &parameters);
    v4l2_fract& interval = parameters.parm.capture.timeperframe;
    if ((parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) == 0) {
      refuse("rate", number(hz) + " Hz", "a camera whose rate cannot be set");
    }
    constexpr double kTicks = 1000;
    interval = {.numerator = static_cast<uint32_t>(kTicks),
                .denominator = static_cast<uint32_t>(std::lround(hz * kTicks))};
    ask("rate", VIDIOC_S_PARM, &parameters);
    ask("rate", VIDIOC_G_PARM, &parameters);
    const double got =
        interval.numerator == 0 ? 0 : double{1} * interval.denominator / interval.numerator;
    if (std::abs(got - hz) > kRateTolerance * hz) {
      refuse("frame rate of a free-running camera", number(hz) + " Hz", number(got) + " Hz");
    }
  }

  /// Sets the exposure time. A camera without these controls has a fixed exposure, or is a frame
  /// grabber.
  void exposure() const {
    if (supports(V4L2_CID_EXPOSURE_AUTO)) {
      control("exposure_auto", V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
    }
    if (!supports(V4L2_CID_EXPOSURE_ABSOLUTE)) return;
    const auto steps = static_cast<int32_t>(std::lround(settings_.exposure_us / kExposureStepUs));
    control("exposure_us / 100", V4L2_CID_EXPOSURE_ABSOLUTE, std::max(steps, 1), 1 + steps / 100);
  }

  const StudioCamera& settings_;
  const std::optional<double> free_rate_hz_;
  V4l2Device& device_;
};

}  // namespace

class V4l2Camera::Stream {
 public:
  Stream(const StudioCamera& settings, std::optional<double> free_rate_hz,
         std::unique_ptr<V4l2Device> device)
      : device_(std::move(device)), pixel_format_(settings.pixel_format) {
    const Setup setup(settings, free_rate_hz, *device_);
    format_ = setup.all();
    v4l2_requestbuffers request{};
    request.count = static_cast<uint32_t>(settings.buffers);
    request.type = kCapture;
    request.memory = V4L2_MEMORY_MMAP;
    setup.ask("buffers", VIDIOC_REQBUFS, &request);
    for (uint32_t i = 0; i < request.count; ++i) add_buffer(setup, i);
    if (buffers_.size() < 2) setup.refuse("buffers", "2", std::to_string(buffers_.size()));
    uint32_t type = kCapture;
    setup.ask("stream", VIDIOC_STREAMON, &type);
  }

  ~Stream() {
    uint32_t type = kCapture;
    device_->control(VIDIOC_STREAMOFF, &type);  // error ignored: a removed device has stopped
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  ImageSize size() const {
    return {static_cast<int>(format_.width), static_cast<int>(format_.height)};
  }
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

  /// The pixels of a complete buffer, without row padding. Empty if the buffer is too short or the
  /// driver marks it as erroneous.
  std::optional<Image> image(const v4l2_buffer& buffer) const {
    const std::span<const uint8_t> bytes = buffers_[buffer.index];
    const size_t row = byte_count({size().width, 1}, pixel_format_);
    const size_t stride = format_.bytesperline;
    const size_t needed = stride * (format_.height - 1) + row;
    if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || buffer.bytesused < needed ||
        bytes.size() < needed) {
      return {};
    }
    Image image;
    image.size = size();
    image.format = pixel_format_;
    image.bytes.reserve(row * format_.height);
    for (size_t y = 0; y < format_.height; ++y) {
      const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(y * stride);
      image.bytes.insert(image.bytes.end(), from, from + static_cast<std::ptrdiff_t>(row));
    }
    return image;
  }

 private:
  void add_buffer(const Setup& setup, uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = kCapture;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    setup.ask("buffers", VIDIOC_QUERYBUF, &buffer);
    if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) {
      setup.refuse("time stamps", "CLOCK_MONOTONIC", "another clock");
    }
    stamp_ = buffer.flags & kStamp;
    const auto memory = device_->map(buffer.length, buffer.m.offset);
    if (memory.empty()) setup.refuse("buffers", "memory", std::strerror(errno));
    buffers_.push_back(memory);
    setup.ask("buffers", VIDIOC_QBUF, &buffer);
  }

  std::unique_ptr<V4l2Device> device_;
  const PixelFormat pixel_format_;
  v4l2_pix_format format_{};
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
  auto device = open_(settings_.address);
  if (!device) {
    throw InputError("camera " + settings_.name + ": " + errno_message(settings_.address));
  }
  stream_ = std::make_unique<Stream>(settings_, free_rate_hz_, std::move(device));
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

CameraStatistics V4l2Camera::statistics() const {
  return {.completed = completed_, .damaged = damaged_};
}

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

}  // namespace v3d::capture
