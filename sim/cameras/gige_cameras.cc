#include "sim/cameras/gige_cameras.h"

#include <arpa/inet.h>
#include <arv.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <mutex>
#include <numbers>

#include "base/core/error.h"
#include "base/io/unique_fd.h"

namespace v3d::sim {
namespace {

// Rate at which a streaming camera polls its trigger register; a trigger is late by up to one
// interval.
constexpr double kPollHz = 250;
/// Frame number of the first frame: close to the maximum, so that the wrap-around comes soon.
constexpr uint16_t kFirstNumber = 65'000;
/// Time for a camera that is unplugged to send the exposed images.
constexpr Duration kMaxSendTime = std::chrono::seconds(1);
constexpr Duration kRetryInterval = std::chrono::milliseconds(2);

/// Sets the timer slack of threads that are started during its life to 1 ms.
///
/// The fake camera of Aravis sleeps whole milliseconds and spins for the rest of its period. With
/// the slack it sleeps longer than the period, so it does not spin.
class TimerSlack {
 public:
  TimerSlack() : before_(prctl(PR_GET_TIMERSLACK)) {
    prctl(PR_SET_TIMERSLACK, std::chrono::nanoseconds(std::chrono::milliseconds(1)).count());
  }
  ~TimerSlack() { prctl(PR_SET_TIMERSLACK, before_); }
  TimerSlack(const TimerSlack&) = delete;
  TimerSlack& operator=(const TimerSlack&) = delete;

 private:
  const long before_;
};

/// Wakes the thread of a fake camera by a packet to its control port.
///
/// The fake camera of Aravis computes its sleep until the next poll. If its thread is preempted
/// during this computation, the result becomes negative, is read as a large number, and the camera
/// sleeps 100 ms. A packet ends this sleep.
class WakeUpSocket {
 public:
  explicit WakeUpSocket(const std::string& address)
      : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in camera{};
    camera.sin_family = AF_INET;
    camera.sin_port = htons(3956);
    if (::inet_pton(AF_INET, address.c_str(), &camera.sin_addr) != 1 ||
        ::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&camera), sizeof camera) != 0) {
      throw InputError(errno_message("camera at " + address));
    }
  }

  /// Sends a GigE Vision read of the version register; the answer is not read.
  void wake() const {
    constexpr uint8_t kReadVersion[] = {0x42, 0x01, 0x00, 0x80, 0, 4, 0, 1, 0, 0, 0, 0};
    ::send(socket_.get(), kReadVersion, sizeof kReadVersion, MSG_DONTWAIT);
  }

 private:
  const io::UniqueFd socket_;
};

uint32_t read_register(ArvFakeCamera* camera, uint32_t address) {
  uint32_t value = 0;
  arv_fake_camera_read_register(camera, address, &value);
  return value;
}

}  // namespace

std::string gige_address(int camera) { return "127.0.0." + std::to_string(11 + camera); }

std::string gige_serial(int camera) {
  const std::string number = std::to_string(camera + 1);
  return "V3D-SIM-" + std::string(number.size() < 2 ? "0" : "") + number;
}

/// The GenICam description as a file in memory, which disappears with the process. Aravis reads it
/// from a file whenever a camera is created.
class GigeCameras::GenicamFile {
 public:
  GenicamFile() : file_(memfd_create("genicam.xml", MFD_CLOEXEC)) {
    const std::string xml = genicam_xml();
    if (!file_ ||
        ::write(file_.get(), xml.data(), xml.size()) != static_cast<ssize_t>(xml.size())) {
      throw InputError(errno_message("memory file for the GenICam description"));
    }
  }
  const char* c_str() const { return path_.c_str(); }

 private:
  const io::UniqueFd file_;
  const std::string path_ = "/proc/self/fd/" + std::to_string(file_.get());
};

/// One camera: the fake camera with its thread while it is plugged in, and the queue of images to
/// send.
class GigeCameras::Device {
 public:
  Device(int index, GigeCamera camera, const GigeCameras& studio, TimerQueue& timers, uint64_t seed)
      : index_(index),
        camera_(std::move(camera)),
        studio_(studio),
        timers_(timers),
        seed_(seed),
        wake_up_(camera_.address),
        acknowledgements_(camera_.address),
        clock_(camera_.clock) {
    if (!plug_in()) {
      throw InputError("camera " + camera_.serial + ": cannot listen on " + camera_.address +
                       " port 3956: the address must be on an interface (ip addr add " +
                       camera_.address + "/32 dev lo) and free");
    }
  }

  ~Device() { g_clear_object(&server_); }  // joins the camera's thread
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void trigger(int64_t edge, MonotonicInstant edge_time, TriggerInput input) {
    const std::lock_guard lock(mutex_);
    const Fault* fault = fault_at(edge);
    if (fault != nullptr) start_fault(*fault, edge, edge_time);
    const bool missed = fault != nullptr && fault->kind == FaultKind::kMissed;
    if (unplugged_ || edge < frozen_until_ || missed) return;
    if (!acquiring() || !listens_to(input)) {
      // An image of the previous acquisition must not be sent in the next one.
      discard_queue();
      write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 0);
      ++ignored_;
      return;
    }
    expose(edge, edge_time, fault);
    send_next();
    wake_up_.wake();
  }

  /// Returns false where the camera does not obey. A command that it misses (FaultKind::kMissed)
  /// has not reached it.
  bool act(int64_t edge, const io::ActionCommand& command, const sockaddr_in& sender) {
    const std::lock_guard lock(mutex_);
    const ActionState state = action_state();
    if (!obeys(state, command)) return false;
    const Fault* fault = fault_at(edge);
    if (fault != nullptr && fault->kind == FaultKind::kMissed) return true;
    const MonotonicInstant now = Monotonic::now();
    const MonotonicInstant due = command.time_ns ? from_ptp(*command.time_ns) : now;
    const io::ActionStatus status = status_of(state, command, due, now);
    if (command.wants_acknowledgement) {
      acknowledgements_.send({.status = status, .request = command.request}, sender);
    }
    if (status == io::ActionStatus::kNoReferenceTime) return true;
    const MonotonicInstant at = std::max(due, now);
    timers_.at(at, [=, this] { trigger(edge, at, TriggerInput::kAction1); });
    return true;
  }

  int64_t ignored() const { return ignored_; }

  bool is_plugged_in() const {
    const std::lock_guard lock(mutex_);
    return !unplugged_;
  }

 private:
  /// An image to send.
  struct QueuedImage {
    Exposure exposure;
    uint16_t number = 0;
    MonotonicInstant not_before;  ///< it is not sent earlier
  };

  // --- the camera on the network; called by the constructor, then by the thread of timers_ only

  /// Returns false when the address does not exist or is not free.
  bool plug_in() {
    const TimerSlack slack;
    ArvGvFakeCamera* server = arv_gv_fake_camera_new_full(
        camera_.address.c_str(), camera_.serial.c_str(), studio_.genicam_->c_str());
    if (server == nullptr || !arv_gv_fake_camera_is_running(server)) {
      g_clear_object(&server);
      return false;
    }
    server_ = server;
    const std::lock_guard lock(mutex_);
    fake_ = arv_gv_fake_camera_get_fake_camera(server_);
    arv_fake_camera_set_trigger_frequency(fake_, kPollHz);
    const auto width = static_cast<uint32_t>(camera_.size.width);
    const auto height = static_cast<uint32_t>(camera_.size.height);
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, width);
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, height);
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
    write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, *pfnc_code(camera_.format));
    write(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, 1000);
    // The fake camera exposes at a write to its trigger register only while this is 1.
    write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE, 1);
    write(registers::kPtpUnlocked, camera_.finds_ptp ? 0 : 1);
    arv_fake_camera_set_fill_pattern(fake_, &Device::fill, this);
    return true;
  }

  /// Waits until the exposed images are sent, at most kMaxSendTime. So the set of sent images does
  /// not depend on the load of the host.
  void unplug(const Fault& fault, MonotonicInstant edge_time) {
    if (Monotonic::now() < edge_time + kMaxSendTime && !all_sent()) {
      timers_.at(Monotonic::now() + kRetryInterval, [=, this] { unplug(fault, edge_time); });
      return;
    }
    {
      const std::lock_guard lock(mutex_);
      fake_ = nullptr;
    }
    g_clear_object(&server_);
    timers_.at(edge_time + fault.time, [=, this] { plug_in_again(fault); });
  }

  bool all_sent() {
    const std::lock_guard lock(mutex_);
    return queue_.empty() || !acquiring();
  }

  void plug_in_again(const Fault& fault) {
    const MonotonicInstant now = Monotonic::now();
    if (!plug_in()) {
      timers_.at(now + kRetryInterval, [=, this] { plug_in_again(fault); });
      return;
    }
    const std::lock_guard lock(mutex_);
    discard_queue();
    number_ = 1;
    if (fault.new_clock) clock_ = {Duration::zero(), clock_.drift_ppm, now};
    unplugged_ = false;
  }

  // --- the next functions require that mutex_ is locked

  const Fault* fault_at(int64_t edge) const {
    const auto found = std::ranges::find(camera_.faults, edge, &Fault::pulse);
    return found == camera_.faults.end() ? nullptr : &*found;
  }

  void start_fault(const Fault& fault, int64_t edge, MonotonicInstant edge_time) {
    if (fault.kind == FaultKind::kFreeze) frozen_until_ = edge + fault.pulses;
    if (fault.kind == FaultKind::kClock) {
      clock_ = {clock_.at(edge_time).time_since_epoch() + fault.time,
                clock_.drift_ppm + fault.drift_ppm, edge_time};
    }
    if (fault.kind == FaultKind::kUnplug && !unplugged_) {
      unplugged_ = true;
      timers_.at(edge_time, [=, this] { unplug(fault, edge_time); });
    }
  }

  void expose(int64_t edge, MonotonicInstant edge_time, const Fault* fault) {
    const auto has = [&](FaultKind kind) { return fault != nullptr && fault->kind == kind; };
    QueuedImage queued;
    queued.exposure = {index_, clock_.at(edge_time + exposure_delay(index_, edge, seed_)),
                       edge_time, edge, has(FaultKind::kBlack)};
    queued.not_before = has(FaultKind::kDelay) ? edge_time + fault->time : edge_time;
    queued.number = next_number();
    if (has(FaultKind::kDrop)) return;
    queue_.push_back(queued);
    if (has(FaultKind::kDuplicate)) {
      queued.number = next_number();
      queue_.push_back(queued);
    }
  }

  uint16_t next_number() {
    const uint16_t number = number_;
    number_ = number == 65535 ? 1 : number + 1;
    return number;
  }

  void discard_queue() {
    queue_.clear();
    triggered_ = false;
  }

  /// Triggers the camera for the first image in the queue, once, when the image is due.
  void send_next() {
    if (queue_.empty() || triggered_ || fake_ == nullptr) return;
    const MonotonicInstant due = queue_.front().not_before;
    if (due <= Monotonic::now()) {
      triggered_ = true;
      return write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
    }
    timers_.at(due, [this] {
      const std::lock_guard lock(mutex_);
      send_next();
    });
  }

  void write(uint32_t address, uint32_t value) {
    arv_fake_camera_write_register(fake_, address, value);
  }

  bool acquiring() const {
    return fake_ != nullptr && arv_fake_camera_get_control_channel_privilege(fake_) != 0 &&
           arv_fake_camera_get_acquisition_status(fake_) != 0 &&
           read_register(fake_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == 1;
  }

  bool listens_to(TriggerInput input) const {
    return read_register(fake_, registers::kTriggerSource) == static_cast<uint32_t>(input);
  }

  ActionState action_state() const {
    if (fake_ == nullptr) return {};
    return {.device_key = read_register(fake_, registers::kActionDeviceKey),
            .group_key = read_register(fake_, registers::kActionGroupKey),
            .group_mask = read_register(fake_, registers::kActionGroupMask),
            .is_controlled = arv_fake_camera_get_control_channel_privilege(fake_) != 0,
            .is_unconditional = read_register(fake_, registers::kActionUnconditional) == 1,
            .follows_ptp = camera_.finds_ptp && read_register(fake_, registers::kPtpEnable) == 1};
  }

  // --- the camera's thread

  /// Called by Aravis after it has cleared the trigger register, for the image to send.
  static void fill(ArvBuffer* buffer, void* user_data, guint32, guint32, ArvPixelFormat) {
    static_cast<Device*>(user_data)->send(buffer);
  }

  void send(ArvBuffer* buffer) {
    QueuedImage queued;
    size_t payload = 0;
    {
      const std::lock_guard lock(mutex_);
      if (queue_.empty() || fake_ == nullptr) {
        return;  // a client wrote the trigger register itself: the previous image is sent again
      }
      payload = arv_fake_camera_get_payload(fake_);
      queued = queue_.front();
      queue_.pop_front();
      triggered_ = false;
      send_next();
    }
    // The buffer has the size of the payload, but Aravis reports this size only after this call.
    auto* data = static_cast<uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, nullptr)));
    if (queued.exposure.black) {
      std::memset(data, 0, payload);
    } else {
      const auto picture = studio_.picture_(index_, queued.exposure.edge);
      const auto image = picture_to_send(picture, queued.exposure.edge_time);
      std::memcpy(data, image.data(), std::min(payload, image.size()));
    }
    arv_buffer_set_timestamp(buffer, static_cast<guint64>(to_ns(queued.exposure.device_time)));
    arv_buffer_set_frame_id(buffer, queued.number);
    studio_.report_(queued.exposure);
  }

  /// The picture under the light at `edge_time`, in the format of the camera. The result is valid
  /// until the next call.
  std::span<const uint8_t> picture_to_send(std::span<const uint8_t> picture,
                                           MonotonicInstant edge_time) {
    const LampFlicker& lamps = camera_.flicker;
    if (lamps.amplitude > 0) {
      const double phase =
          2 * std::numbers::pi * lamps.hz * to_seconds(edge_time.time_since_epoch());
      const double light = 1 + lamps.amplitude * std::sin(phase);
      sent_.assign(picture.begin(), picture.end());
      for (uint8_t& sample : sent_) {
        sample = static_cast<uint8_t>(std::clamp(std::lround(sample * light), 0L, 255L));
      }
      picture = sent_;
    }
    if (!is_deep(camera_.format.image)) return picture;
    sent_ = packed_samples(picture, camera_.format);
    return sent_;
  }

  const int index_;
  const GigeCamera camera_;
  const GigeCameras& studio_;
  TimerQueue& timers_;
  const uint64_t seed_;
  const WakeUpSocket wake_up_;
  const AcknowledgementSocket acknowledgements_;
  ArvGvFakeCamera* server_ = nullptr;  ///< null while unplugged

  /// Guards the next members and the order of writes to the trigger register.
  mutable std::mutex mutex_;
  ArvFakeCamera* fake_ = nullptr;  ///< owned by server_; null while unplugged
  SimulatedClock clock_;
  uint16_t number_ = kFirstNumber;  ///< of the next frame
  bool unplugged_ = false;          ///< edges are ignored: it is unplugged, or will be
  int64_t frozen_until_ = 0;        ///< edges before this one are ignored
  std::deque<QueuedImage> queue_;
  bool triggered_ = false;  ///< the trigger register holds the first image of the queue
  std::atomic<int64_t> ignored_{0};
  std::vector<uint8_t> sent_;  ///< the camera's thread only
};

std::vector<uint8_t> packed_samples(std::span<const uint8_t> samples, CameraFormat format) {
  if (!is_deep(format.image)) return {samples.begin(), samples.end()};
  const int bits = bits_per_sample(format.image);
  const int low_bits = bits - 8;
  const auto deep = [&](size_t i) {
    return static_cast<uint32_t>(samples[i] << low_bits | (i & ((1U << low_bits) - 1)));
  };
  std::vector<uint8_t> bytes;
  bytes.reserve(2 * samples.size());
  const auto add = [&](uint32_t byte) { bytes.push_back(static_cast<uint8_t>(byte)); };
  uint64_t window = 0;
  int waiting = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (format.layout == PixelLayout::kPlain) {
      add(deep(i));
      add(deep(i) >> 8);
    } else if (format.layout == PixelLayout::kLsbPacked) {
      window |= uint64_t{deep(i)} << waiting;
      for (waiting += bits; waiting >= 8; waiting -= 8, window >>= 8)
        add(static_cast<uint32_t>(window));
    } else if (i % 2 == 0) {  // GigE Vision: two samples in three bytes
      const uint32_t low = (1U << low_bits) - 1;
      add(deep(i) >> low_bits);
      add((deep(i) & low) | (deep(i + 1) & low) << 4);
      add(deep(i + 1) >> low_bits);
    }
  }
  return bytes;
}

GigeCameras::GigeCameras(std::vector<GigeCamera> cameras, Picture picture, Report report,
                         uint64_t seed)
    : picture_(std::move(picture)),
      report_(std::move(report)),
      genicam_(std::make_unique<GenicamFile>()) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    devices_.push_back(
        std::make_unique<Device>(static_cast<int>(i), std::move(cameras[i]), *this, timers_, seed));
  }
  receiver_ =
      std::make_unique<ActionReceiver>([this](const io::ActionCommand& command,
                                              const sockaddr_in& sender) { act(command, sender); });
}

GigeCameras::~GigeCameras() {
  receiver_.reset();
  timers_.end();
}

void GigeCameras::act(const io::ActionCommand& command, const sockaddr_in& sender) {
  bool is_obeyed = false;
  for (const auto& device : devices_) {
    is_obeyed = device->act(actions_, command, sender) || is_obeyed;
  }
  if (is_obeyed) ++actions_;
}

void GigeCameras::trigger(int64_t edge, MonotonicInstant edge_time) {
  for (const auto& device : devices_) {
    device->trigger(edge, edge_time, TriggerInput::kLine1);
  }
}

int64_t GigeCameras::ignored() const {
  int64_t sum = 0;
  for (const auto& device : devices_) {
    sum += device->ignored();
  }
  return sum;
}

bool GigeCameras::is_plugged_in(int camera) const {
  return devices_[static_cast<size_t>(camera)]->is_plugged_in();
}

}  // namespace v3d::sim
