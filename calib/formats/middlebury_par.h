// _par.txt of the Middlebury multi-view data sets: a count, then a line for each image, "NAME k11
// k12 ... k33 r11 r12 ... r33 t1 t2 t3", with image point = K [R t] world point.
// Source: the README of each set at vision.middlebury.edu/mview/data.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/camera_model.h"

namespace v3d::calib {

/// A camera is named after its image, without the extension. The file does not tell the size of the
/// images, which are undistorted. Its metres stay metres; which way is up differs by set. Where the
/// centre of a pixel lies the sets do not say: taken as base/camera_model.h has it. Throws
/// InputError with `path` and line.
Rig parse_middlebury(std::string_view text, ImageSize size, const std::filesystem::path& path);

/// The rig as parse_middlebury() reads it, images named NAME.png. Throws InputError that names a
/// camera with distortion, which the format cannot tell.
std::string middlebury_text(const Rig& rig);

}  // namespace v3d::calib
