// Files of calibrations in the formats of several programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::calibrate {

enum class RigFormat {
  kToml,        ///< calib.toml of V3D, aniposelib, Pose2Sim; camera_array.toml (read only)
  kOpencv,      ///< YAML of OpenCV, one file per camera
  kOpencvXml,   ///< XML of OpenCV, one file per camera
  kColmap,      ///< a folder with cameras.txt and images.txt
  kMiddlebury,  ///< _par.txt
};
std::string_view name(RigFormat format);
/// "toml", "opencv", "opencv-xml", "colmap", "middlebury". Throws InputError, with `option` in
/// front.
RigFormat parse_rig_format(std::string_view text, std::string_view option);

/// The format that the name of the path or the content of the folder implies; empty where unknown.
std::optional<RigFormat> detect_rig_format(const std::filesystem::path& path);

struct RigFile {
  std::string path;  ///< a file; colmap: a folder; opencv: also a folder or a pattern
  RigFormat format = RigFormat::kToml;
  std::optional<ImageSize> size;  ///< for formats without an image size
};

/// Throws InputError with the file and the error.
Rig load_rig(const RigFile& file);

/// Writes the rig in `format` and returns the written files.
///
/// For opencv and colmap, `path` is a folder, which is created where needed; for opencv it may be a
/// file where the rig has one camera. Throws InputError for a rig that the format does not support,
/// before anything is written.
std::vector<std::filesystem::path> save_rig(const std::filesystem::path& path, RigFormat format,
                                            const Rig& rig);

}  // namespace v3d::calibrate
