// A camera in a file of OpenCV's FileStorage: XML, YAML or JSON. The adapter of that reader.
//
// OpenCV fixes how a matrix is written, not what it is called. Read are the names that its samples
// and other programs use: camera_matrix, cameraMatrix, CameraMatrix, K; distortion_coefficients,
// distCoeffs, DistortionCoeffs, dist_coeffs, D; R, rvec, Rotation (3x3 or Rodrigues); T, t, tvec,
// Translation; image_width and image_height, or image_size, imageSize, resolution. Conventions are
// those of base/camera_model.h; OpenCV's own functions pass over skew.
//
// OpenCV 4.6 dies of some XML whose attributes are broken: only for files of the user's own.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/camera_model.h"

namespace v3d::calib {

/// What a file does not tell: the camera's name where it has no `name`, and often the size of its
/// images.
struct OpencvDefaults {
  std::string name;
  std::optional<ImageSize> size{};
};

/// The camera, at the origin where the file tells no place; or two, NAME_1 and NAME_2, of a file
/// with M1, D1, M2, D2 (and R, T: of the second from the first), as OpenCV's sample of stereo
/// calibration writes. Throws InputError with `path`, what is missing and what would be right;
/// fisheye lenses are refused.
Rig parse_opencv(std::string_view text, const OpencvDefaults& defaults,
                 const std::filesystem::path& path);

enum class OpencvFormat { kYaml, kXml };

/// The camera as parse_opencv() reads it: name, image_width, image_height, camera_matrix,
/// distortion_coefficients, R (3x3), T. Throws InputError for a lens with skew.
std::string opencv_text(const RigCamera& camera, OpencvFormat format);

}  // namespace v3d::calib
