// calib.toml: the rig, in the layout that aniposelib, Pose2Sim and caliscope write.
#pragma once

#include <filesystem>

#include "base/geometry/camera_model.h"

namespace v3d {

/// One [cam_*] table per camera (Pose2Sim's are named as it likes, and have a matrix): name, size
/// [width, height], matrix (3x3, pixels), distortions (0, 4, 5, 8, 12 or 14 numbers, OpenCV order),
/// rotation (Rodrigues, or the rows of the matrix; cam_from_world), translation (metres). Optional,
/// and passed over by other programs: colour_black (3 grey values) and colour_matrix (3x3), see
/// ColourResponse. Order of the file. caliscope's own camera_array.toml is read, too: its
/// [cameras.N] is named cam_N, as its videos are, and ignore = true leaves a camera out. Throws
/// InputError with file, line and field: missing or ill-typed fields, wrong lengths, two cameras of
/// one name, names that are no file names, a matrix that is no camera matrix or no rotation,
/// fisheye = true (not supported).
Rig load_calib(const std::filesystem::path& path);

/// The same from text; `path` names it in messages.
Rig parse_calib(std::string_view text, const std::filesystem::path& path);

/// As many distortions as are used: 5, 8, 12 or 14. Writes what load_calib() reads back to the last
/// bits (a rotation vector is not a rotation matrix). Where a result must be the same to the bit,
/// copy the file instead. Replaces the file in one step.
void save_calib(const std::filesystem::path& path, const Rig& rig);

}  // namespace v3d
