#include "capture/cameras/aravis_device.h"

#include <cmath>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/time.h"

namespace v3d::capture::aravis {
namespace {

/// The list of devices is global in Aravis and is addressed by index.
std::mutex& device_list_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::string device_with_serial(const std::string& serial) {
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const char* found = arv_get_device_serial_nbr(i);
    if (found && serial == found) return arv_get_device_id(i);
  }
  return {};
}

std::string serials_found() {
  std::string list;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const char* serial = arv_get_device_serial_nbr(i);
    list += (list.empty() ? "" : ", ") + std::string(serial ? serial : "?");
  }
  return list.empty() ? "no camera" : list;
}

Owned<ArvCamera> open_by_address(const StudioCamera& settings) {
  Problem problem;
  Owned<ArvCamera> camera(arv_camera_new(settings.address.c_str(), problem));
  if (!camera || problem.happened()) {
    throw InputError("camera " + settings.name + ": no answer from " + settings.address + " (" +
                     problem.text() + ")");
  }
  return camera;
}

/// Searches the network only if the device list of the last search does not lead to the camera: a
/// search takes one second, and a node opens many cameras.
Owned<ArvCamera> open_by_serial(const StudioCamera& settings) {
  const std::lock_guard lock(device_list_mutex());
  std::string cause;
  for (const bool search : {false, true}) {
    if (search) arv_update_device_list();
    const std::string id = device_with_serial(settings.address);
    if (id.empty()) continue;
    Problem problem;
    Owned<ArvCamera> camera(arv_camera_new(id.c_str(), problem));
    if (camera && !problem.happened()) return camera;
    cause = problem.text();
  }
  throw InputError(
      "camera " + settings.name + ": " +
      (cause.empty()
           ? "no camera has the serial number '" + settings.address + "'; found: " + serials_found()
           : "found serial number " + settings.address + ", but cannot open it: " + cause));
}

}  // namespace

Owned<ArvCamera> open(const StudioCamera& settings) {
  const bool is_ip = g_hostname_is_ip_address(settings.address.c_str());
  return is_ip ? open_by_address(settings) : open_by_serial(settings);
}

namespace {

constexpr PtpNames kNames[] = {
    {"PtpEnable", "PtpStatus", "PtpDataSetLatch", "PtpOffsetFromMaster"},
    {"GevIEEE1588", "GevIEEE1588Status", "GevIEEE1588DataSetLatch", "GevIEEE1588OffsetFromMaster"}};

}  // namespace

std::optional<Ptp> Ptp::of(ArvCamera* camera) {
  for (const PtpNames& names : kNames) {
    if (has_feature(camera, names.enable)) return Ptp(camera, names);
  }
  return {};
}

std::string Ptp::status() const {
  Problem problem;
  const char* status = arv_camera_get_string(camera_, names_.status, problem);
  return problem.happened() || !status ? "no answer" : status;
}

bool Ptp::is_synchronised() const {
  const std::string now = status();
  return now == "Slave" || now == "Master";
}

std::optional<Duration> Ptp::offset() const {
  Problem latched;
  arv_camera_execute_command(camera_, names_.latch, latched);
  Problem asked;
  const gint64 offset = arv_camera_get_integer(camera_, names_.offset, asked);
  return is_synchronised() && !asked.happened() ? std::optional(Duration(offset)) : std::nullopt;
}

namespace {

/// Maximum time for a camera to select a PTP master together with the others, and to follow it.
constexpr Duration kPtpTimeout = std::chrono::seconds(20);
/// Where only an action trigger uses PTP. Shorter than the time that arming waits for cameras.
constexpr Duration kActionPtpTimeout = std::chrono::seconds(10);
constexpr Duration kPtpPollPeriod = std::chrono::milliseconds(100);

/// Writes settings to the camera and reads them back.
class Setup {
 public:
  Setup(const StudioCamera& settings, ArvCamera* camera)
      : settings_(settings), camera_(camera), writer_(settings, camera) {}

  /// The free features come before the trigger and the stream, which they must not change.
  std::vector<SettingDifference> all() {
    stop_acquisition();
    load_user_set(settings_, writer_);
    choose("AcquisitionMode", "Continuous");
    choose("PixelFormat", std::string(name(settings_.pixel_format)));
    write_region(settings_, camera_, writer_);
    switch_automatic_off(writer_);
    exposure();
    gain();
    write_features(settings_, writer_);
    trigger();
    if (arv_camera_is_gv_device(camera_)) gigabit();
    if (settings_.chunk_data) chunk_data();
    if (settings_.ptp || settings_.action) follow_ptp();
    return writer_.differences();
  }

 private:
  [[noreturn]] void fail(const std::string& feature, const std::string& wanted,
                         const std::string& got) const {
    aravis::fail(settings_, feature, wanted, got);
  }

  bool supports(const char* feature) const { return has_feature(camera_, feature); }

  /// If a program crashed, the camera still acquires: it sends its images to that program, and its
  /// pixel format is locked.
  void stop_acquisition() {
    Problem problem;
    arv_camera_stop_acquisition(camera_, problem);
    if (problem.happened()) fail("AcquisitionStop", "a stopped camera", problem.text());
  }

  void choose(const char* feature, const std::string& wanted) {
    Problem set;
    arv_camera_set_string(camera_, feature, wanted.c_str(), set);
    if (set.happened()) fail(feature, wanted, set.text());
    Problem get;
    const char* got = arv_camera_get_string(camera_, feature, get);
    if (get.happened() || !got) fail(feature, wanted, get.text());
    if (wanted != got) fail(feature, wanted, got);
  }

  void choose_if_supported(const char* feature, const std::string& wanted) {
    if (supports(feature)) choose(feature, wanted);
  }

  /// Writes a number and reads it back. Cameras round values to their own steps; an error up to
  /// `tolerance` is accepted.
  template <class Set, class Get>
  void number(const char* feature, double wanted, double tolerance, Set set, Get get) {
    Problem setting;
    set(setting);
    if (setting.happened()) fail(feature, std::to_string(wanted), setting.text());
    Problem getting;
    const double got = get(getting);
    if (getting.happened()) fail(feature, std::to_string(wanted), getting.text());
    if (!(std::abs(got - wanted) <= tolerance)) {
      fail(feature, std::to_string(wanted), std::to_string(got));
    }
    if (got != wanted) writer_.add_rounded(feature, toml_number(wanted), toml_number(got));
  }

  void exposure() {
    const double wanted = settings_.exposure_us;
    number(
        "ExposureTime (us)", wanted, 1 + 0.01 * wanted,
        [&](GError** e) { arv_camera_set_exposure_time(camera_, wanted, e); },
        [&](GError** e) { return arv_camera_get_exposure_time(camera_, e); });
  }

  void gain() {
    Problem problem;
    if (!arv_camera_is_gain_available(camera_, problem) && settings_.gain_db == 0) return;
    number(
        "Gain (dB)", settings_.gain_db, 0.1,
        [&](GError** e) { arv_camera_set_gain(camera_, settings_.gain_db, e); },
        [&](GError** e) { return arv_camera_get_gain(camera_, e); });
  }

  /// Writes the trigger mode last: otherwise the camera would expose at the edges of the line that
  /// was selected before.
  void trigger() {
    Problem clear;
    arv_camera_clear_triggers(camera_, clear);
    if (clear.happened()) fail("TriggerMode", "Off", clear.text());
    choose_if_supported("TriggerSelector", "FrameStart");
    if (settings_.action) {
      action(*settings_.action);
      return choose("TriggerMode", "On");
    }
    choose("TriggerSource", settings_.trigger_line);
    if (settings_.trigger_edge == Edge::kFalling) {
      choose("TriggerActivation", "FallingEdge");
    } else {
      choose_if_supported("TriggerActivation", "RisingEdge");
    }
    choose("TriggerMode", "On");
  }

  /// The camera exposes at action commands with these keys.
  void action(const ActionKeys& keys) {
    if (!supports("ActionDeviceKey")) {
      fail("ActionDeviceKey", std::to_string(keys.device_key),
           "a camera without action commands; trigger it by cable, [trigger] kind = \"gpio\" or "
           "\"scpi\"");
    }
    writer_.write_if_supported("ActionUnconditionalMode", "Off");
    write_integer(settings_, camera_, "ActionDeviceKey", keys.device_key);
    write_integer(settings_, camera_, "ActionSelector", keys.signal);
    write_integer(settings_, camera_, "ActionGroupKey", keys.group_key);
    write_integer(settings_, camera_, "ActionGroupMask", keys.group_mask);
    choose("TriggerSource", "Action" + std::to_string(keys.signal));
  }

  void gigabit() {
    if (settings_.packet_size == 0) {
      Problem problem;
      arv_camera_gv_auto_packet_size(camera_, problem);
      if (problem.happened())
        fail("packet size", "the largest that the network passes", problem.text());
    } else {
      number(
          "GevSCPSPacketSize", settings_.packet_size, 0,
          [&](GError** e) { arv_camera_gv_set_packet_size(camera_, settings_.packet_size, e); },
          [&](GError** e) { return arv_camera_gv_get_packet_size(camera_, e); });
    }
    arv_camera_gv_set_packet_size_adjustment(camera_, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    packet_delay();
    arv_camera_gv_set_stream_options(camera_, settings_.packet_socket
                                                  ? ARV_GV_STREAM_OPTION_NONE
                                                  : ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  }

  /// The register counts ticks of the camera's clock, so the value read back may be one tick less.
  /// A camera without the register has no delay.
  void packet_delay() {
    if (!supports("GevSCPD") && settings_.packet_delay_ns == 0) return;
    number(
        "GevSCPD (ns)", settings_.packet_delay_ns, 100,
        [&](GError** e) { arv_camera_gv_set_packet_delay(camera_, settings_.packet_delay_ns, e); },
        [&](GError** e) {
          return static_cast<double>(arv_camera_gv_get_packet_delay(camera_, e));
        });
  }

  void switch_on(const char* feature) {
    Problem set;
    arv_camera_set_boolean(camera_, feature, true, set);
    if (set.happened()) fail(feature, "true", set.text());
    Problem get;
    const bool on = arv_camera_get_boolean(camera_, feature, get);
    if (get.happened() || !on) fail(feature, "true", get.happened() ? get.text() : "false");
  }

  /// Waits until the clock is synchronised: a clock that steps during a take makes frames suspect.
  /// An action trigger alone does not require it: its commands then have no time.
  void follow_ptp() {
    const std::optional<Ptp> ptp = Ptp::of(camera_);
    if (!ptp && settings_.ptp) fail("ptp", "PtpEnable", "a camera without it");
    if (!ptp) return writer_.add_difference("PtpEnable", "true", "a camera without it");
    switch_on(ptp->enable_feature());
    const MonotonicInstant deadline =
        Monotonic::now() + (settings_.ptp ? kPtpTimeout : kActionPtpTimeout);
    while (!ptp->is_synchronised() && Monotonic::now() < deadline)
      std::this_thread::sleep_for(kPtpPollPeriod);
    if (ptp->is_synchronised()) return;
    if (settings_.ptp) fail(ptp->status_feature(), "Slave or Master", ptp->status());
    writer_.add_difference(ptp->status_feature(), "Slave or Master", ptp->status());
  }

  /// Requests the exposure time. Every image already has its time stamp and frame number.
  void chunk_data() {
    if (!supports("ChunkModeActive")) fail("chunk_data", "ChunkModeActive", "a camera without it");
    switch_on("ChunkModeActive");
    choose("ChunkSelector", "ExposureTime");
    switch_on("ChunkEnable");
  }

  const StudioCamera& settings_;
  ArvCamera* camera_;
  FeatureWriter writer_;
};

}  // namespace

void fail(const StudioCamera& settings, const std::string& feature, const std::string& wanted,
          const std::string& got) {
  throw InputError("camera " + settings.name + ": " + feature + ": expected " + wanted +
                   ", found " + got);
}

std::vector<SettingDifference> write_settings(const StudioCamera& settings, ArvCamera* camera) {
  return Setup(settings, camera).all();
}

}  // namespace v3d::capture::aravis
