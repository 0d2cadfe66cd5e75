// calib.toml: reader and writer of the rig, in the format of aniposelib, Pose2Sim and caliscope.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/geometry/camera_model.h"

namespace v3d {

/// Reads the rig from a calibration file; the cameras keep the order of the file.
///
/// Each [cam_*] table, and each other table with a matrix (Pose2Sim), is one camera. Fields: name;
/// size [width, height]; matrix (3x3, pixels); distortions (0, 4, 5, 8, 12 or 14 numbers, OpenCV
/// order); rotation (Rodrigues vector, or the rows of the matrix; cam_from_world); translation
/// (metres).
/// Optional fields, which other programs ignore: colour_black (3 grey values) and colour_matrix
/// (3x3), see ColourResponse.
/// caliscope's own camera_array.toml: the camera of table [cameras.N] gets the name cam_N, like its
/// video; ignore = true omits a camera.
/// Throws InputError with file, line and field for: missing or ill-typed fields, wrong lengths, two
/// cameras with the same name, names that are not valid file names, a matrix that is not a camera
/// matrix or not a rotation, fisheye = true (not supported).
Rig load_calib(const std::filesystem::path& path);

/// Like load_calib(), but reads `text`. Error messages use `path` as the file name.
Rig parse_calib(std::string_view text, const std::filesystem::path& path);

/// The text of the rig that save_calib() writes. parse_calib() rejects it where a number exceeds
/// its limits.
std::string calib_text(const Rig& rig);

/// Writes the rig to a file, which it replaces atomically. Throws std::runtime_error with path and
/// cause.
/// Writes 5, 8, 12 or 14 distortions, as many as the camera uses.
/// load_calib() returns the same values up to rounding, because the file stores a rotation vector
/// and not a matrix. Copy the file where the values must stay identical to the bit.
void save_calib(const std::filesystem::path& path, const Rig& rig);

}  // namespace v3d
