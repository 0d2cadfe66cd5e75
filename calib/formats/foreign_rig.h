// Shared parts of the readers and writers of other programs' calibrations.
//
// The conventions of all formats are those of base/geometry/camera_model.h, unless a header says
// otherwise: x_cam = R x_world + t; x right, y down, z forward; distortion coefficients in OpenCV's
// order. No format states the upward axis and the unit of its world; metric_rig() applies them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// The rotation nearest to a matrix that is a rotation up to rounding errors; empty for others.
std::optional<Eigen::Matrix3d> as_rotation(const Eigen::Matrix3d& matrix);

/// Whether the matrix is [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0.
bool is_camera_matrix(const Eigen::Matrix3d& matrix);
inline constexpr std::string_view kCameraMatrixRule =
    "expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0";

bool is_image_size(int64_t width, int64_t height);

/// Camera names from file names: the names without folder and extension, or the names of the
/// folders where only these differ. Throws InputError, with `where` in front, for duplicate names
/// and for invalid camera names.
std::vector<std::string> camera_names(const std::vector<std::filesystem::path>& files,
                                      const std::filesystem::path& where);

/// The rig in metres with z up.
///
/// `unit_m`: length of a unit of the rig's world in metres. `up`: upward axis of the rig's world,
/// "x", "-x", "y", "-y", "z" or "-z". Throws InputError for another axis.
Rig metric_rig(const Rig& rig, double unit_m, std::string_view up);

}  // namespace v3d::calib
