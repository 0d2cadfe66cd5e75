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

// Writes GenICam features as text and reads them back. For capture/cameras/aravis_*.cc only.

/// Writes features and collects the differences between what was asked and what the camera did.
/// `settings` and `camera` must outlive it. Not thread-safe.
class FeatureWriter {
 public:
  FeatureWriter(const StudioCamera& settings, ArvCamera* camera)
      : settings_(settings), camera_(camera) {}

  /// Writes the feature and reads it back; a command is executed if `value` is "true". A value that
  /// the camera rejects or changes is a difference.
  /// Throws InputError (see fail()) if the camera has no such feature.
  void write(const std::string& feature, const std::string& value);
  /// Like write(); a camera without the feature is left as it is.
  void write_if_supported(const std::string& feature, const std::string& value);
  /// Adds a difference that is within the tolerance of the setting.
  void add_rounded(const std::string& feature, const std::string& asked, const std::string& got);

  /// Adds a difference beyond the tolerance of the setting.
  void add_difference(const std::string& feature, const std::string& asked, const std::string& got);

  const std::vector<SettingDifference>& differences() const { return differences_; }

 private:
  const StudioCamera& settings_;
  ArvCamera* const camera_;
  std::vector<SettingDifference> differences_;
};

/// True for equal texts, and for numbers that differ by at most 1e-5 of their size: Aravis prints
/// six digits.
bool is_same_value(const std::string& asked, const std::string& got);

/// Writes a whole number and reads it back, where the camera permits to read it.
/// Throws InputError (see fail()) if it is another one afterwards.
void write_integer(const StudioCamera& settings, ArvCamera* camera, const std::string& feature,
                   int64_t wanted);
/// Loads the user set of the studio file, if it names one. It replaces all settings of the camera.
void load_user_set(const StudioCamera& settings, FeatureWriter& writer);
/// Writes binning, mirroring and the region of the sensor. Without a size in the studio file, the
/// region stays as it is.
/// Throws InputError (see fail()) if the region differs afterwards.
void write_region(const StudioCamera& settings, ArvCamera* camera, FeatureWriter& writer);
/// Switches everything off with which a camera changes its pictures by itself, and makes the image
/// linear.
void switch_automatic_off(FeatureWriter& writer);
/// Writes black level, strobe output and the table [camera.features], in this order.
void write_features(const StudioCamera& settings, FeatureWriter& writer);

}  // namespace v3d::capture::aravis
