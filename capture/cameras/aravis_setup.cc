#include "capture/cameras/aravis_setup.h"

#include <cmath>
#include <optional>
#include <thread>

#include "base/core/error.h"
#include "base/core/time.h"
#include "capture/cameras/aravis_object.h"
#include "capture/cameras/aravis_ptp.h"

namespace v3d::aravis {
namespace {

/// A camera has so long to agree with the others on a master and to follow it.
constexpr Duration kPtpWithin = std::chrono::seconds(20);
constexpr Duration kPtpLook = std::chrono::milliseconds(100);

/// Writes settings and reads them back.
class Setup {
 public:
  Setup(const StudioCamera& settings, ArvCamera* camera) : settings_(settings), camera_(camera) {}

  void all() {
    stop_what_runs();
    choose("AcquisitionMode", "Continuous");
    choose("PixelFormat", std::string(name(settings_.pixel_format)));
    choose_if_there("ExposureAuto", "Off");
    choose_if_there("GainAuto", "Off");
    exposure();
    gain();
    trigger();
    if (arv_camera_is_gv_device(camera_)) gigabit();
    if (settings_.chunk_data) chunk_data();
    if (settings_.ptp) follow_ptp();
  }

 private:
  [[noreturn]] void refuse(const std::string& feature, const std::string& wanted,
                           const std::string& got) const {
    aravis::refuse(settings_, feature, wanted, got);
  }

  bool there(const char* feature) const { return has_feature(camera_, feature); }

  /// A program that died left the camera acquiring: it would go on sending to that program, and
  /// its format is locked.
  void stop_what_runs() {
    Problem problem;
    arv_camera_stop_acquisition(camera_, problem);
    if (problem.happened()) refuse("AcquisitionStop", "a camera at rest", problem.text());
  }

  void choose(const char* feature, const std::string& wanted) {
    Problem set;
    arv_camera_set_string(camera_, feature, wanted.c_str(), set);
    if (set.happened()) refuse(feature, wanted, set.text());
    Problem get;
    const char* got = arv_camera_get_string(camera_, feature, get);
    if (get.happened() || !got) refuse(feature, wanted, get.text());
    if (wanted != got) refuse(feature, wanted, got);
  }

  void choose_if_there(const char* feature, const std::string& wanted) {
    if (there(feature)) choose(feature, wanted);
  }

  /// Cameras round to their own steps: `tolerance` is what we let them.
  template <class Set, class Get>
  void number(const char* feature, double wanted, double tolerance, Set set, Get get) {
    Problem setting;
    set(setting);
    if (setting.happened()) refuse(feature, std::to_string(wanted), setting.text());
    Problem getting;
    const double got = get(getting);
    if (getting.happened()) refuse(feature, std::to_string(wanted), getting.text());
    if (!(std::abs(got - wanted) <= tolerance)) {
      refuse(feature, std::to_string(wanted), std::to_string(got));
    }
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

  /// The mode comes last: a camera that is switched on first would expose at the edges of whatever
  /// line it listened to before.
  void trigger() {
    Problem clear;
    arv_camera_clear_triggers(camera_, clear);
    if (clear.happened()) refuse("TriggerMode", "Off", clear.text());
    choose_if_there("TriggerSelector", "FrameStart");
    choose("TriggerSource", settings_.trigger_line);
    if (settings_.trigger_edge == Edge::kFalling) {
      choose("TriggerActivation", "FallingEdge");
    } else {
      choose_if_there("TriggerActivation", "RisingEdge");
    }
    choose("TriggerMode", "On");
  }

  void gigabit() {
    if (settings_.packet_size == 0) {
      Problem problem;
      arv_camera_gv_auto_packet_size(camera_, problem);
      if (problem.happened()) refuse("packet size", "the largest that passes", problem.text());
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

  /// Given in ticks of the camera's clock, so it may come back a tick short. A camera without the
  /// register has no delay.
  void packet_delay() {
    if (!there("GevSCPD") && settings_.packet_delay_ns == 0) return;
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
    if (set.happened()) refuse(feature, "true", set.text());
    Problem get;
    const bool on = arv_camera_get_boolean(camera_, feature, get);
    if (get.happened() || !on) refuse(feature, "true", get.happened() ? get.text() : "false");
  }

  /// Streams only when its clock is in step: a clock that is set right in the middle of a take
  /// makes its frames suspect.
  void follow_ptp() {
    const std::optional<Ptp> ptp = Ptp::of(camera_);
    if (!ptp) refuse("ptp", "PtpEnable", "a camera without it");
    switch_on(ptp->enable_feature());
    const MonotonicInstant deadline = Monotonic::now() + kPtpWithin;
    while (!ptp->in_step() && Monotonic::now() < deadline) std::this_thread::sleep_for(kPtpLook);
    if (!ptp->in_step()) refuse(ptp->status_feature(), "Slave or Master", ptp->status());
  }

  /// Time stamp and frame number stand in front of every image anyway; the exposure does not.
  void chunk_data() {
    if (!there("ChunkModeActive")) refuse("chunk_data", "ChunkModeActive", "a camera without it");
    switch_on("ChunkModeActive");
    choose("ChunkSelector", "ExposureTime");
    switch_on("ChunkEnable");
  }

  const StudioCamera& settings_;
  ArvCamera* camera_;
};

}  // namespace

void refuse(const StudioCamera& settings, const std::string& feature, const std::string& wanted,
            const std::string& got) {
  throw InputError("camera " + settings.name + ": " + feature + ": wanted " + wanted + ", got " +
                   got);
}

void write_settings(const StudioCamera& settings, ArvCamera* camera) {
  Setup(settings, camera).all();
}

}  // namespace v3d::aravis
