// Simulated GigE Vision cameras: Aravis' fake camera on loopback addresses, so that the real
// capture path is used.
//
// The addresses must exist. In a network namespace (unshare -Urn):
//   ip link set lo up mtu 65536
//   ip route add 224.0.0.0/4 dev lo          # LCM's multicast
//   for i in $(seq 11 25); do ip addr add 127.0.0.$i/32 dev lo; done
//
// A pulse on the simulated cable is written to the software trigger register of the fake camera,
// which the camera's thread polls. The GenICam description names this trigger source "Line1"; with
// "Action1" a camera obeys action commands to 127.255.255.255 instead (triggers.h). The
// register holds one pulse; further pulses are queued, so a slow camera sends late but skips no
// pulse. Device time stamps are those of the edge. Frame numbers are 16-bit numbers without 0. They
// start near their maximum, and at 1 after a camera was unplugged.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "base/image/camera_format.h"
#include "base/image/image.h"
#include "sim/cameras/device_clock.h"
#include "sim/cameras/exposure_record.h"
#include "sim/cameras/triggers.h"

namespace v3d::sim {

/// Lamps whose light is mean * (1 + amplitude * sin(2 pi hz t)).
struct LampFlicker {
  double amplitude = 0;  ///< 0: steady light
  double hz = 0;
};

struct GigeCamera {
  std::string address;  ///< IPv4, on an interface of this host
  std::string serial;   ///< at most 15 characters
  ImageSize size;
  CameraFormat format = PixelFormat::kBayerRG8;  ///< with a PFNC code
  SimulatedClock clock;
  std::vector<Fault> faults;  ///< `pulse` is an edge number; at most one fault per edge
  LampFlicker flicker = {};   ///< of the light in its images
  bool finds_ptp = true;      ///< its clock follows PTP when this is enabled
};

/// Converts samples of 8 bits to the layout of `format`, whose samples have 10 or 12 bits; the new
/// low bits are those of a counter, so that tests find them again. A plain format of 8 bits stays
/// as it is. Requires a format with a PFNC code and whole groups of samples (width_step()).
std::vector<uint8_t> packed_samples(std::span<const uint8_t> samples, CameraFormat format);

/// "127.0.0.11" for camera 0.
std::string gige_address(int camera);
/// "V3D-SIM-01" for camera 0.
std::string gige_serial(int camera);

/// A sent image. A duplicate fault sends it twice.
struct Exposure {
  int camera = 0;
  DeviceInstant device_time;  ///< start of exposure
  MonotonicInstant edge_time;
  int64_t edge = 0;
  bool black = false;  ///< a fault replaced the image by black
};

class GigeCameras {
 public:
  /// The image of a camera at an edge, with 8 bits per sample; its bytes must stay valid. Called by
  /// any thread.
  using Picture = std::function<std::span<const uint8_t>(int camera, int64_t edge)>;
  /// Called by the camera's thread before an image is sent. Must not throw.
  using Report = std::function<void(const Exposure&)>;

  /// Starts the cameras. `seed` determines the exposure delays. Throws InputError with camera and
  /// address where an address cannot be bound.
  GigeCameras(std::vector<GigeCamera> cameras, Picture picture, Report report, uint64_t seed);
  ~GigeCameras();
  GigeCameras(const GigeCameras&) = delete;
  GigeCameras& operator=(const GigeCameras&) = delete;

  /// A rising edge on the trigger line of all cameras. Cameras that are not acquiring, or do not
  /// trigger on Line1, ignore it. Faults of this edge are injected. Call it from one thread.
  void trigger(int64_t edge, MonotonicInstant edge_time);
  /// The number of action commands that a camera obeyed.
  int64_t actions() const { return actions_; }
  /// The number of edges that cameras without a fault ignored, over all cameras.
  int64_t ignored() const;
  /// False from the edge of a fault that unplugs the camera until the camera obeys edges again.
  bool is_plugged_in(int camera) const;

 private:
  class GenicamFile;
  class Device;
  /// Called by the thread of receiver_. The commands that a camera obeys are edges, counted from 0.
  void act(const io::ActionCommand& command, const sockaddr_in& sender);
  const Picture picture_;
  const Report report_;
  const std::unique_ptr<GenicamFile> genicam_;
  TimerQueue timers_;  ///< must end before the devices, whose threads use it
  std::vector<std::unique_ptr<Device>> devices_;
  std::atomic<int64_t> actions_ = 0;
  std::unique_ptr<ActionReceiver> receiver_;  ///< last member: its thread uses the others
};

// The GenICam description of the simulated cameras, over the register map of Aravis' fake camera
// (arvfakecamera.h).

/// XML of the GenApi schema 1.1, with feature names of the SFNC.
std::string genicam_xml();

}  // namespace v3d::sim
