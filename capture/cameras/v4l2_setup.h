// Writes the settings of the studio file to a V4L2 camera. For capture/cameras/v4l2_camera.cc only.
#pragma once

#include <linux/videodev2.h>

#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/cameras/pixel_decoder.h"
#include "capture/cameras/v4l2_camera.h"

namespace v3d::capture::v4l2 {

/// Settings that a camera has after write_settings().
struct Applied {
  SentLayout layout;
  std::string device;  ///< name of the device and its driver
  /// Automatic controls that stay on, controls of [camera.features] with another value, an exposure
  /// time that was rounded to the steps of V4L2, and a frame interval that is longer than the
  /// period of the pulses.
  std::vector<SettingDifference> differences;
  /// Of a triggered camera with a frame interval: the rate of pulses, Hz, above which the settings
  /// must be written again.
  std::optional<double> trigger_rate_hz;
};

/// Whether a camera with the frame rate `got_hz` can follow pulses of `hz`.
bool is_fast_enough(double got_hz, double hz);

/// Writes all settings and reads them back. Switches every automatic control off first. Sets the
/// frame interval by `rate_hz`, the rate of the pulses (empty: unknown):
///   - without a trigger control, the camera must run at this rate;
///   - with a trigger control, it becomes the longest interval that is not longer than the period,
///     because many drivers bound exposure and rate by it. No frame interval is no fault.
/// Throws InputError (see fail()) if a value of the studio file differs afterwards.
Applied write_settings(const StudioCamera& settings, std::optional<double> rate_hz,
                       V4l2Device& device);

/// Calls device.control(). Throws InputError (see fail()) on an error.
void control_or_throw(const StudioCamera& settings, V4l2Device& device, const std::string& what,
                      unsigned long request, void* argument);

/// Throws InputError such as "camera cam07: size: expected 640x480, found 320x240".
[[noreturn]] void fail(const StudioCamera& settings, const std::string& what,
                       const std::string& wanted, const std::string& got);

}  // namespace v3d::capture::v4l2
