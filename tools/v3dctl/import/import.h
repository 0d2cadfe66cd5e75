// Real recordings become a take.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "v3dctl/import/image_file.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

struct ImportOptions {
  std::filesystem::path take;
  std::filesystem::path calib;
  std::filesystem::path images;          ///< either this
  std::filesystem::path masks;           ///< with images, or empty
  std::vector<CameraFile> videos;        ///< or this
  std::vector<CameraFile> backgrounds;   ///< a video, a folder of images, or one image
  std::optional<BlackBackground> black;  ///< makes the masks from the images
  FrameRange frames;
  double rate_hz = 0;  ///< 0: as the videos say, else 25
};

struct ImportResult {
  int64_t frames = 0;
  std::vector<std::string> cameras;
  double rate_hz = 0;
};

/// Throws InputError for everything that is wrong with the input; the take is then not there.
ImportResult import_take(const ImportOptions& options);

/// "LEVEL" or "LEVEL:GROW:SHRINK", level 0..1, pixels 0..100. Throws InputError.
BlackBackground parse_black_background(std::string_view text);

}  // namespace v3d::ctl
