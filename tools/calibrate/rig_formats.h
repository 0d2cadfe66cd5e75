// Calibrations in the formats of several programs, from files and to files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/camera_model.h"

namespace v3d::calibrate {

enum class RigFormat {
  kToml,        ///< calib.toml of aniposelib, Pose2Sim, caliscope; ours; camera_array.toml, read
  kOpencv,      ///< YAML of OpenCV, a file for each camera
  kOpencvXml,   ///< the same as XML
  kColmap,      ///< a folder with cameras.txt and images.txt
  kMiddlebury,  ///< _par.txt
};
std::string_view name(RigFormat format);
/// "toml", "opencv", "opencv-xml", "colmap", "middlebury". Throws InputError, `option` in front.
RigFormat parse_rig_format(std::string_view text, std::string_view option);

/// By the path's name, or by what is in the folder; empty where they do not tell.
std::optional<RigFormat> guess_rig_format(const std::filesystem::path& path);

struct RigFile {
  std::string path;  ///< a file; colmap: a folder; opencv: a folder or a pattern too
  RigFormat format = RigFormat::kToml;
  std::optional<ImageSize> size;  ///< for formats that do not tell it
};

/// Throws InputError with the file and what is wrong in it.
Rig load_rig(const RigFile& file);

/// Writes the rig in `format`; opencv and colmap: into the folder `path`, which is made where it is
/// not there (opencv: or into a file, where the rig is one camera). The files that were written.
/// Throws InputError for a rig that the format cannot tell of, before anything is written.
std::vector<std::filesystem::path> save_rig(const std::filesystem::path& path, RigFormat format,
                                            const Rig& rig);

}  // namespace v3d::calibrate
