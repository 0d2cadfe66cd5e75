#include "sim/gige_cameras.h"

#include <arpa/inet.h>
#include <arv.h>
#include <netinet/in.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <mutex>

#include "base/error.h"
#include "sim/genicam.h"

namespace v3d::sim {
namespace {

// How often a camera looks for a pulse: the trigger is late by up to this much, and every camera
// wakes up this often while it streams.
constexpr double kPollHz = 250;

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

/// Aravis reads the description from a file, once, when a camera is created.
class GenicamFile {
 public:
  GenicamFile() {
    std::string name = std::filesystem::temp_directory_path() / "v3d-sim-genicam-XXXXXX";
    const int file = mkstemp(name.data());
    const std::string xml = genicam_xml();
    if (file < 0 || ::write(file, xml.data(), xml.size()) != static_cast<ssize_t>(xml.size())) {
      throw InputError(errno_message(name));
    }
    ::close(file);
    path_ = name;
  }
  ~GenicamFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  GenicamFile(const GenicamFile&) = delete;
  GenicamFile& operator=(const GenicamFile&) = delete;
  const char* c_str() const { return path_.c_str(); }

 private:
  std::string path_;
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

/// One camera: the fake camera with its thread, and the pulses that wait for it.
class GigeCameras::Device {
 public:
  Device(int index, const GigeCamera& camera, const char* genicam, const Picture& picture,
         const Report& report, uint64_t seed)
      : index_(index),
        clock_(camera.clock),
        picture_(picture),
        report_(report),
        seed_(seed),
        door_(camera.address) {
    server_ = arv_gv_fake_camera_new_full(camera.address.c_str(), camera.serial.c_str(), genicam);
    if (server_ == nullptr || !arv_gv_fake_camera_is_running(server_)) {
      g_clear_object(&server_);
      throw InputError("camera " + camera.serial + ": cannot listen on " + camera.address +
                       " port 3956: the address must be on an interface (ip addr add " +
                       camera.address + "/32 dev lo) and free");
    }
    fake_ = arv_gv_fake_camera_get_fake_camera(server_);
    arv_fake_camera_set_trigger_frequency(fake_, kPollHz);
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, static_cast<uint32_t>(camera.size.width));
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, static_cast<uint32_t>(camera.size.height));
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, static_cast<uint32_t>(camera.size.width));
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, static_cast<uint32_t>(camera.size.height));
    write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, static_cast<uint32_t>(camera.format));
    write(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, 1000);
    arv_fake_camera_set_fill_pattern(fake_, &Device::fill, this);
  }

  ~Device() { g_clear_object(&server_); }  // joins the camera's thread
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void trigger(int64_t edge, MonotonicInstant edge_time) {
    const std::lock_guard lock(mutex_);
    if (!listening()) {
      // A pulse that came just before the end of an acquisition must not open the next one.
      waiting_.clear();
      write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 0);
      ++ignored_;
      return;
    }
    waiting_.push_back(
        {index_, clock_.at(edge_time + exposure_delay(index_, edge, seed_)), edge_time, edge});
    if (waiting_.size() == 1) {
      write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
    }
    door_.knock();
  }

  int64_t ignored() const { return ignored_; }

 private:
  void write(uint32_t address, uint32_t value) {
    arv_fake_camera_write_register(fake_, address, value);
  }

  bool listening() const {
    return arv_fake_camera_get_control_channel_privilege(fake_) != 0 &&
           arv_fake_camera_get_acquisition_status(fake_) != 0 &&
           read_register(fake_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == 1 &&
           read_register(fake_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE) == 1;
  }

  /// Aravis has taken the pulse out of the register and wants the image to send.
  static void fill(ArvBuffer* buffer, void* user_data, guint32, guint32, ArvPixelFormat) {
    static_cast<Device*>(user_data)->expose(buffer);
  }

  void expose(ArvBuffer* buffer) {
    Exposure exposure;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_.empty()) {
        return;  // a client wrote the trigger register itself: the image of the last pulse again
      }
      exposure = waiting_.front();
      waiting_.pop_front();
      if (!waiting_.empty()) {
        write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
      }
    }
    // Aravis calls with a buffer of the payload's size, which it reports only once filled.
    auto* data = static_cast<uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, nullptr)));
    const std::span<const uint8_t> image = picture_(exposure.camera, exposure.edge);
    std::memcpy(data, image.data(), std::min(arv_fake_camera_get_payload(fake_), image.size()));
    arv_buffer_set_timestamp(buffer, static_cast<guint64>(to_ns(exposure.device_time)));
    report_(exposure);
  }

  const int index_;
  const SimulatedClock clock_;
  const Picture& picture_;
  const Report& report_;
  const uint64_t seed_;
  const Knock door_;
  ArvGvFakeCamera* server_ = nullptr;
  ArvFakeCamera* fake_ = nullptr;  ///< owned by server_
  std::mutex mutex_;  ///< guards waiting_ and the order of writes to the trigger register
  std::deque<Exposure> waiting_;  ///< the first one is in the register
  std::atomic<int64_t> ignored_{0};
};

GigeCameras::GigeCameras(std::vector<GigeCamera> cameras, Picture picture, Report report,
                         uint64_t seed)
    : picture_(std::move(picture)), report_(std::move(report)) {
  const GenicamFile genicam;
  const LazyTimers lazy;
  for (size_t i = 0; i < cameras.size(); ++i) {
    devices_.push_back(std::make_unique<Device>(static_cast<int>(i), cameras[i], genicam.c_str(),
                                                picture_, report_, seed));
  }
}

GigeCameras::~GigeCameras() = default;

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
