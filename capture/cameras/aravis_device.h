// GenICam devices by Aravis: discovery, PTP, configuration.
#pragma once

#include <arv.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "capture/cameras/camera.h"

namespace v3d::capture::aravis {

// RAII wrappers for Aravis objects (GObject) and errors (GError). For capture/cameras/aravis_*.cc
// only.

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <class T>
using Owned = std::unique_ptr<T, Unref>;

/// The GError of one Aravis call. The destructor frees it.
class Problem {
 public:
  Problem() = default;
  ~Problem() { g_clear_error(&error_); }
  Problem(const Problem&) = delete;
  Problem& operator=(const Problem&) = delete;
  operator GError**() { return &error_; }  // NOLINT(google-explicit-constructor)
  bool happened() const { return error_ != nullptr; }
  std::string text() const { return error_ ? error_->message : "no reason given"; }

 private:
  GError* error_ = nullptr;
};

/// Reports whether the camera has a GenICam feature. False if the query fails.
inline bool has_feature(ArvCamera* camera, const char* feature) {
  Problem problem;
  return arv_camera_is_feature_available(camera, feature, problem) && !problem.happened();
}

// Device discovery with Aravis: finds and opens a camera. For capture/cameras/aravis_*.cc only.

/// Opens the camera that `settings.address` names: an IPv4 address, otherwise a serial number.
///
/// Throws InputError with the name of the camera and the serial numbers that were found.
/// Thread-safe; only one search runs at a time.
Owned<ArvCamera> open(const StudioCamera& settings);

// PTP (IEEE 1588) state of a camera's clock. For capture/cameras/aravis_*.cc only.

/// GenICam names of the PTP features: SFNC 2.2 and later, or the older Gev names.
struct PtpNames {
  const char* enable;
  const char* status;
  const char* latch;
  const char* offset;
};

/// Every call queries the camera. The camera must outlive this object. Not thread-safe.
class Ptp {
 public:
  /// Empty if the camera has no PTP.
  static std::optional<Ptp> of(ArvCamera* camera);

  const char* enable_feature() const { return names_.enable; }
  const char* status_feature() const { return names_.status; }
  /// The state that the camera reports: "Slave", "Master", "Listening", ...; "no answer" on error.
  std::string status() const;
  /// The clock is a synchronised slave, or the master of the studio.
  bool is_synchronised() const;
  /// Offset of the camera's clock from its master. Empty while it is not synchronised.
  std::optional<Duration> offset() const;

 private:
  Ptp(ArvCamera* camera, const PtpNames& names) : camera_(camera), names_(names) {}

  ArvCamera* camera_;
  PtpNames names_;
};

// Writes the studio file's settings to a camera. For capture/cameras/aravis_*.cc only.

/// Stops acquisition, writes every setting and reads it back. With `ptp` it waits until the
/// camera's clock is synchronised, at most 20 s; with an action trigger at most 10 s, and a clock
/// that is not synchronised is a difference. Returns rounded values, automatic functions that
/// stay on, and features of [camera.features] that differ.
/// Throws InputError (see fail()) if another value differs.
std::vector<SettingDifference> write_settings(const StudioCamera& settings, ArvCamera* camera);

/// Throws InputError such as "camera cam07: Gain (dB): expected 3.0, found 1.0".
[[noreturn]] void fail(const StudioCamera& settings, const std::string& feature,
                       const std::string& wanted, const std::string& got);

}  // namespace v3d::capture::aravis
