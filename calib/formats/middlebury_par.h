// _par.txt of the Middlebury multi-view data sets.
//
// The first line is the number of images. Each further line describes one image: "NAME k11 k12 ...
// k33 r11 r12 ... r33 t1 t2 t3", with image point = K [R t] world point.
// Source: the README of each set at vision.middlebury.edu/mview/data.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// Reads a rig. A camera has the name of its image, without extension.
///
/// `size`: size of the images, which the file does not state. The images are undistorted. The world
/// is in metres; the upward axis depends on the set. The sets do not define pixel centres; those of
/// base/geometry/camera_model.h are assumed. Throws InputError with `path` and line.
Rig parse_middlebury(std::string_view text, ImageSize size, const std::filesystem::path& path);

/// Writes the rig in the form that parse_middlebury() reads, with images named NAME.png.
/// Throws InputError with the name of a camera with distortion, which the format does not support.
std::string middlebury_text(const Rig& rig);

}  // namespace v3d::calib
