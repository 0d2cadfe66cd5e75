// The simulated cameras on the network: GigE Vision devices of Aravis' fake camera, one per
// loopback address, so that the capture side is driven through its real path.
//
// The addresses must exist before; in a network namespace of one's own (unshare -Urn):
//   ip link set lo up mtu 65536
//   ip route add 224.0.0.0/4 dev lo          # LCM's multicast
//   for i in $(seq 11 25); do ip addr add 127.0.0.$i/32 dev lo; done
//
// A pulse on the cable plays the part of the trigger line: it is put into the fake camera's
// software-trigger register, which the camera's thread polls; the GenICam description calls that
// trigger source "Line1". One pulse is in the register at a time, later ones wait in line, so a
// slow camera sends late but never skips. Device time stamps are those of the edge, not of the
// sending. Frame numbers are our own: 16 bits that skip 0, near their end at first, from 1 after a
// camera was unplugged.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/time.h"
#include "sim/device_clock.h"
#include "sim/fault.h"
#include "sim/later.h"

namespace v3d::sim {

struct GigeCamera {
  std::string address;  ///< IPv4, on an interface of this host
  std::string serial;   ///< at most 15 characters
  ImageSize size;
  PixelFormat format = PixelFormat::kBayerRG8;
  SimulatedClock clock;
  std::vector<Fault> faults;  ///< their `pulse` is an edge; one at an edge at most
};

/// "127.0.0.11" for camera 0.
std::string gige_address(int camera);
/// "V3D-SIM-01" for camera 0.
std::string gige_serial(int camera);

/// An image that a camera has taken and now sends; twice, where a fault says so.
struct Exposure {
  int camera = 0;
  DeviceInstant device_time;  ///< start of exposure
  MonotonicInstant edge_time;
  int64_t edge = 0;
  bool black = false;  ///< a fault: not the picture that was asked for
};

class GigeCameras {
 public:
  /// The image a camera takes at an edge; size * format bytes that stay valid. Any thread.
  using Picture = std::function<std::span<const uint8_t>(int camera, int64_t edge)>;
  /// Called by the camera's thread before the image leaves. Must not throw.
  using Report = std::function<void(const Exposure&)>;

  /// Starts to serve. Throws InputError naming the camera and the address that cannot be bound.
  /// `seed` chooses the exposure delays.
  GigeCameras(std::vector<GigeCamera> cameras, Picture picture, Report report, uint64_t seed);
  ~GigeCameras();
  GigeCameras(const GigeCameras&) = delete;
  GigeCameras& operator=(const GigeCameras&) = delete;

  /// One rising edge on every camera's trigger line. A camera that is not acquiring, or not set to
  /// trigger on Line1, ignores it, and one that has a fault at this edge plays it. One thread.
  void trigger(int64_t edge, MonotonicInstant edge_time);
  /// Edges that cameras without a fault ignored, all cameras together.
  int64_t ignored() const;

 private:
  class GenicamFile;
  class Device;
  const Picture picture_;
  const Report report_;
  const std::unique_ptr<GenicamFile> genicam_;
  Later later_;  ///< ends before the devices, which ask it until their threads have ended
  std::vector<std::unique_ptr<Device>> devices_;
};

}  // namespace v3d::sim
