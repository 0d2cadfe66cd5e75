// Rigs as text of other programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

// Shared parts of the readers and writers of other programs' calibrations.
//
// The conventions of all formats are those of base/geometry/camera_model.h, unless a header says
// otherwise: x_cam = R x_world + t; x right, y down, z forward; distortion coefficients in OpenCV's
// order. No format states the upward axis and the unit of its world; metric_rig() applies them.

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

// COLMAP's text model: cameras.txt (lenses) and images.txt (poses).
//
// Conventions are those of base/geometry/camera_model.h except for pixels: (0.5, 0.5) is the centre
// of the first pixel, so the principal point is larger by half a pixel. Unit and orientation of the
// world are arbitrary. Source: colmap.github.io/format.html, colmap.github.io/cameras.html

struct ColmapText {
  std::string cameras;  ///< cameras.txt
  std::string images;   ///< images.txt
};

/// Reads one camera for each image, in the order of the images.
///
/// A camera has the name of its image file, or of the folder where only the folders differ. Lens
/// models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV. `folder`:
/// location of the files, for messages. Throws InputError with file and line; the message names an
/// unsupported lens model.
Rig parse_colmap(const ColmapText& text, const std::filesystem::path& folder);

/// Writes the rig in the form that parse_colmap() reads, with images named NAME.png and no points.
/// Throws InputError with the name of a camera whose lens COLMAP cannot express: skew, thin prism,
/// tilted sensor.
ColmapText colmap_text(const Rig& rig);

// _par.txt of the Middlebury multi-view data sets.
//
// The first line is the number of images. Each further line describes one image: "NAME k11 k12 ...
// k33 r11 r12 ... r33 t1 t2 t3", with image point = K [R t] world point.
// Source: the README of each set at vision.middlebury.edu/mview/data.

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
