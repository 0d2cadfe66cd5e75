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
  /// Automatic controls that stay on, and controls of [camera.features] with another value.
  std::vector<SettingDifference> differences;
};

/// Writes all settings and reads them back. Switches every automatic control off first. With
/// `free_rate_hz` and without a trigger control, sets the frame interval.
/// Throws InputError (see refuse()) if a value of the studio file differs afterwards.
Applied write_settings(const StudioCamera& settings, std::optional<double> free_rate_hz,
                       V4l2Device& device);

/// Calls device.control(). Throws InputError (see refuse()) on an error.
void ask(const StudioCamera& settings, V4l2Device& device, const std::string& what,
         unsigned long request, void* argument);

/// Throws InputError such as "camera cam07: size: wanted 640x480, got 320x240".
[[noreturn]] void refuse(const StudioCamera& settings, const std::string& what,
                         const std::string& wanted, const std::string& got);

}  // namespace v3d::capture::v4l2
