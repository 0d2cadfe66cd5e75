// What the readers and writers of other programs' calibrations share. All of them speak of cameras
// as base/camera_model.h does - x_cam = R x_world + t, x right, y down, z forward, distortions in
// OpenCV's order - except where their headers say otherwise. Their world is taken as it is: which
// way is up, and how long a unit is, none of the formats tell; placed_rig() says it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/camera_model.h"

namespace v3d::calib {

/// The rotation nearest to a matrix that is one but for rounding; empty where it is none.
std::optional<Eigen::Matrix3d> as_rotation(const Eigen::Matrix3d& matrix);

/// Whether it reads [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0.
bool is_camera_matrix(const Eigen::Matrix3d& matrix);
inline constexpr std::string_view kCameraMatrixRule =
    "expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0";

bool is_image_size(int64_t width, int64_t height);

/// Names for cameras, of the files that belong to them: without folder and extension, or by the
/// folders where only these differ. Throws InputError, with `where` in front, where two remain the
/// same or one cannot name a camera.
std::vector<std::string> camera_names(const std::vector<std::filesystem::path>& files,
                                      const std::filesystem::path& where);

/// The rig in metres and with z up. `up`: the axis of the rig's world that points up: "x", "-x",
/// "y", ... Throws InputError for any other.
Rig placed_rig(const Rig& rig, double unit_m, std::string_view up);

}  // namespace v3d::calib
