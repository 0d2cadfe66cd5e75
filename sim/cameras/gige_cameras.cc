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
#include <cstdlib>
#include <cstring>
#include <deque>
#include <mutex>

#include "base/core/error.h"
#include "sim/cameras/genicam.h"

namespace v3d::sim {
namespace {

// How often a camera looks for a pulse: the trigger is late by up to this much, and every camera
// wakes up this often while it streams.
constexpr double kPollHz = 250;
/// The first frame's: so that a counter's end is passed soon.
constexpr uint16_t kFirstNumber = 65'000;
/// A camera that is unplugged has so long to send what it has taken.
constexpr Duration kSentWithin = std::chrono::seconds(1);
constexpr Duration kUntilNextLook = std::chrono::milliseconds(2);

/// Aravis' camera sleeps whole milliseconds and spins for the rest of its period. Threads begun
/// while this lives may sleep a millisecond longer, which is past that rest: they do not spin.
class LazyTimers {
 public:
  LazyTimers() : before_(prctl(PR_GET_TIMERSLACK)) {
    prctl(PR_SET_TIMERSLACK, std::chrono::nanoseconds(std::chrono::milliseconds(1)).count());
  }
  ~LazyTimers() { prctl(PR_SET_TIMERSLACK, before_); }
  LazyTimers(const LazyTimers&) = delete;
  LazyTimers& operator=(const LazyTimers&) = delete;

 private:
  const long before_;
};

/// Aravis' camera computes how long it may sleep until it looks for a pulse again; when its thread
/// loses the processor in the middle of that, the rest has become negative, is taken for a large
/// number, and the camera sleeps 100 ms. Whoever speaks to it wakes it.
class Knock {
 public:
  explicit Knock(const std::string& address)
      : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in camera{};
    camera.sin_family = AF_INET;
    camera.sin_port = htons(3956);
    if (::inet_pton(AF_INET, address.c_str(), &camera.sin_addr) != 1 ||
        ::connect(socket_, reinterpret_cast<const sockaddr*>(&camera), sizeof camera) != 0) {
      ::close(socket_);
      throw InputError(errno_message("camera at " + address));
    }
  }
  ~Knock() { ::close(socket_); }
  Knock(const Knock&) = delete;
  Knock& operator=(const Knock&) = delete;

  /// Asks for the version register, as GigE Vision has it; nobody reads the answer.
  void knock() const {
    constexpr uint8_t kReadVersion[] = {0x42, 0x01, 0x00, 0x80, 0, 4, 0, 1, 0, 0, 0, 0};
    ::send(socket_, kReadVersion, sizeof kReadVersion, MSG_DONTWAIT);
  }

 private:
  const int socket_;
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

/// Aravis reads the description from a file whenever a camera is created. This one has a name only
/// as long as the process lives, however that ends.
class GigeCameras::GenicamFile {
 public:
  GenicamFile() : file_(memfd_create("genicam.xml", MFD_CLOEXEC)) {
    const std::string xml = genicam_xml();
    if (file_ < 0 || ::write(file_, xml.data(), xml.size()) != static_cast<ssize_t>(xml.size())) {
      throw InputError(errno_message("the cameras' description, in memory"));
    }
  }
  ~GenicamFile() { ::close(file_); }
  GenicamFile(const GenicamFile&) = delete;
  GenicamFile& operator=(const GenicamFile&) = delete;
  const char* c_str() const { return path_.c_str(); }

 private:
  const int file_;
  const std::string path_ = "/proc/self/fd/" + std::to_string(file_);
};

/// One camera: the fake camera with its thread while it is plugged in, and the images that wait to
/// be sent.
class GigeCameras::Device {
 public:
  Device(int index, GigeCamera camera, const GigeCameras& studio, TimerQueue& later, uint64_t seed)
      : index_(index),
        camera_(std::move(camera)),
        studio_(studio),
        later_(later),
        seed_(seed),
        door_(camera_.address),
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

  void trigger(int64_t edge, MonotonicInstant edge_time) {
    const std::lock_guard lock(mutex_);
    const Fault* fault = fault_at(edge);
    if (fault != nullptr) begin(*fault, edge, edge_time);
    const bool missed = fault != nullptr && fault->kind == FaultKind::kMissed;
    if (away_ || edge < frozen_until_ || missed) return;
    if (!listening()) {
      // A pulse that came just before the end of an acquisition must not open the next one.
      forget_waiting();
      write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 0);
      ++ignored_;
      return;
    }
    expose(edge, edge_time, fault);
    send_next();
    door_.knock();
  }

  int64_t ignored() const { return ignored_; }

 private:
  /// An image on its way out.
  struct Shot {
    Exposure exposure;
    uint16_t number = 0;
    MonotonicInstant not_before;
  };

  // --- the camera on the network; called by the constructor, then by `later_` only

  /// False when the address is not there or not free.
  bool plug_in() {
    const LazyTimers lazy;
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
    write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, static_cast<uint32_t>(camera_.format));
    write(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, 1000);
    arv_fake_camera_set_fill_pattern(fake_, &Device::fill, this);
    return true;
  }

  /// Images that were taken before leave first: which ones do must not depend on how busy the host
  /// is.
  void unplug(const Fault& fault, MonotonicInstant edge_time) {
    if (Monotonic::now() < edge_time + kSentWithin && !all_sent()) {
      later_.at(Monotonic::now() + kUntilNextLook, [=, this] { unplug(fault, edge_time); });
      return;
    }
    {
      const std::lock_guard lock(mutex_);
      fake_ = nullptr;
    }
    g_clear_object(&server_);
    later_.at(edge_time + fault.time, [=, this] { come_back(fault); });
  }

  bool all_sent() {
    const std::lock_guard lock(mutex_);
    return waiting_.empty() || !listening();
  }

  void come_back(const Fault& fault) {
    const MonotonicInstant now = Monotonic::now();
    if (!plug_in()) {
      later_.at(now + kUntilNextLook, [=, this] { come_back(fault); });
      return;
    }
    const std::lock_guard lock(mutex_);
    forget_waiting();
    number_ = 1;
    if (fault.new_clock) clock_ = {Duration::zero(), clock_.drift_ppm, now};
    away_ = false;
  }

  // --- what follows requires mutex_

  const Fault* fault_at(int64_t edge) const {
    const auto found = std::ranges::find(camera_.faults, edge, &Fault::pulse);
    return found == camera_.faults.end() ? nullptr : &*found;
  }

  void begin(const Fault& fault, int64_t edge, MonotonicInstant edge_time) {
    if (fault.kind == FaultKind::kFreeze) frozen_until_ = edge + fault.pulses;
    if (fault.kind == FaultKind::kClock) {
      clock_ = {clock_.at(edge_time).time_since_epoch() + fault.time,
                clock_.drift_ppm + fault.drift_ppm, edge_time};
    }
    if (fault.kind == FaultKind::kUnplug && !away_) {
      away_ = true;
      later_.at(edge_time, [=, this] { unplug(fault, edge_time); });
    }
  }

  void expose(int64_t edge, MonotonicInstant edge_time, const Fault* fault) {
    const auto has = [&](FaultKind kind) { return fault != nullptr && fault->kind == kind; };
    Shot shot;
    shot.exposure = {index_, clock_.at(edge_time + exposure_delay(index_, edge, seed_)), edge_time,
                     edge, has(FaultKind::kBlack)};
    shot.not_before = has(FaultKind::kDelay) ? edge_time + fault->time : edge_time;
    shot.number = next_number();
    if (has(FaultKind::kDrop)) return;
    waiting_.push_back(shot);
    if (has(FaultKind::kDuplicate)) {
      shot.number = next_number();
      waiting_.push_back(shot);
    }
  }

  uint16_t next_number() {
    const uint16_t number = number_;
    number_ = number == 65535 ? 1 : number + 1;
    return number;
  }

  void forget_waiting() {
    waiting_.clear();
    asked_ = false;
  }

  /// Hands the first image that waits to the camera, once, when it is time.
  void send_next() {
    if (waiting_.empty() || asked_ || fake_ == nullptr) return;
    const MonotonicInstant due = waiting_.front().not_before;
    if (due <= Monotonic::now()) {
      asked_ = true;
      return write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
    }
    later_.at(due, [this] {
      const std::lock_guard lock(mutex_);
      send_next();
    });
  }

  void write(uint32_t address, uint32_t value) {
    arv_fake_camera_write_register(fake_, address, value);
  }

  bool listening() const {
    return fake_ != nullptr && arv_fake_camera_get_control_channel_privilege(fake_) != 0 &&
           arv_fake_camera_get_acquisition_status(fake_) != 0 &&
           read_register(fake_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == 1 &&
           read_register(fake_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE) == 1;
  }

  // --- the camera's thread

  /// Aravis has taken the pulse out of the register and wants the image to send.
  static void fill(ArvBuffer* buffer, void* user_data, guint32, guint32, ArvPixelFormat) {
    static_cast<Device*>(user_data)->send(buffer);
  }

  void send(ArvBuffer* buffer) {
    Shot shot;
    size_t payload = 0;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_.empty() || fake_ == nullptr) {
        return;  // a client wrote the trigger register itself: the image of the last pulse again
      }
      payload = arv_fake_camera_get_payload(fake_);
      shot = waiting_.front();
      waiting_.pop_front();
      asked_ = false;
      send_next();
    }
    // Aravis calls with a buffer of the payload's size, which it reports only once filled.
    auto* data = static_cast<uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, nullptr)));
    if (shot.exposure.black) {
      std::memset(data, 0, payload);
    } else {
      const auto image = studio_.picture_(index_, shot.exposure.edge);
      std::memcpy(data, image.data(), std::min(payload, image.size()));
    }
    arv_buffer_set_timestamp(buffer, static_cast<guint64>(to_ns(shot.exposure.device_time)));
    arv_buffer_set_frame_id(buffer, shot.number);
    studio_.report_(shot.exposure);
  }

  const int index_;
  const GigeCamera camera_;
  const GigeCameras& studio_;
  TimerQueue& later_;
  const uint64_t seed_;
  const Knock door_;
  ArvGvFakeCamera* server_ = nullptr;  ///< null while unplugged

  std::mutex mutex_;  ///< what follows, and the order of writes to the trigger register
  ArvFakeCamera* fake_ = nullptr;  ///< owned by server_; null while unplugged
  SimulatedClock clock_;
  uint16_t number_ = kFirstNumber;  ///< of the next frame
  bool away_ = false;               ///< edges are not seen: it is unplugged, or about to be
  int64_t frozen_until_ = 0;        ///< edges before this one are not seen
  std::deque<Shot> waiting_;
  bool asked_ = false;  ///< the first one that waits is in the register
  std::atomic<int64_t> ignored_{0};
};

GigeCameras::GigeCameras(std::vector<GigeCamera> cameras, Picture picture, Report report,
                         uint64_t seed)
    : picture_(std::move(picture)),
      report_(std::move(report)),
      genicam_(std::make_unique<GenicamFile>()) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    devices_.push_back(
        std::make_unique<Device>(static_cast<int>(i), std::move(cameras[i]), *this, later_, seed));
  }
}

GigeCameras::~GigeCameras() { later_.end(); }

void GigeCameras::trigger(int64_t edge, MonotonicInstant edge_time) {
  for (const auto& device : devices_) {
    device->trigger(edge, edge_time);
  }
}

int64_t GigeCameras::ignored() const {
  int64_t sum = 0;
  for (const auto& device : devices_) {
    sum += device->ignored();
  }
  return sum;
}

}  // namespace v3d::sim
