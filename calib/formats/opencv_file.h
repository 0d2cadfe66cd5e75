// Camera files of OpenCV's FileStorage: XML, YAML or JSON. The adapter of OpenCV's reader.
//
// OpenCV defines the notation of a matrix, but not its name. These names, which OpenCV's samples
// and other programs use, are accepted: camera_matrix, cameraMatrix, CameraMatrix, K;
// distortion_coefficients, distCoeffs, DistortionCoeffs, dist_coeffs, D; R, rvec, Rotation (3x3 or
// Rodrigues); T, t, tvec, Translation; image_width and image_height, or image_size, imageSize,
// resolution. Conventions are those of base/geometry/camera_model.h. OpenCV's own functions ignore
// skew.
//
// Use the reader only for files of the user: OpenCV 4.6 crashes on some XML with malformed
// attributes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// Values that are used where a file does not state them.
struct OpencvDefaults {
  std::string name;  ///< of the camera
  std::optional<ImageSize> size{};
};

/// Reads one camera, at the origin where the file states no pose.
///
/// A file with M1, D1, M2, D2 (and R, T: second from first), as OpenCV's stereo sample writes it,
/// gives two cameras, NAME_1 and NAME_2. Throws InputError with `path`, the error and what is
/// expected; also for fisheye lenses.
Rig parse_opencv(std::string_view text, const OpencvDefaults& defaults,
                 const std::filesystem::path& path);

enum class OpencvFormat { kYaml, kXml };

/// Writes the camera in the form that parse_opencv() reads: name, image_width, image_height,
/// camera_matrix, distortion_coefficients, R (3x3), T. Throws InputError for a lens with skew.
std::string opencv_text(const RigCamera& camera, OpencvFormat format);

}  // namespace v3d::calib
