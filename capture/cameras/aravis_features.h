// Writes GenICam features as text and reads them back. For capture/cameras/aravis_*.cc only.
#pragma once

#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/cameras/aravis_device.h"
#include "capture/cameras/camera.h"

namespace v3d::capture::aravis {

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
