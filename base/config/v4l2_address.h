// Device files of V4L2 cameras, by path, serial number or place on the bus.
#pragma once

#include <filesystem>

#include "base/config/studio_file.h"

namespace v3d {

/// The device file of a camera of kind v4l2. `settings.address` is one of
///   - a path, which starts with "/": returned as it is;
///   - "bus:" and the path of the bus connection, as the property ID_PATH of udev names it;
///   - a serial number.
/// udev's links below `links` (by-path, by-id) lead to the device. A camera with several device
/// files is opened by the first (index 0), which has the images.
/// Throws InputError with the name of the camera and what was found. Thread-safe.
std::filesystem::path v4l2_device(const StudioCamera& settings,
                                  const std::filesystem::path& links = "/dev/v4l");

}  // namespace v3d
