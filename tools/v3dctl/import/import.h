// Import: recordings of other sources become a take.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "v3dctl/import/media.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

/// Has either `images` or `videos`.
struct ImportOptions {
  std::filesystem::path take;
  std::filesystem::path calib;
  std::filesystem::path images;          ///< folder
  std::filesystem::path masks;           ///< of the images; empty: none
  std::vector<CameraFile> videos;        ///< one for each camera
  std::vector<CameraFile> backgrounds;   ///< of the empty studio: a video, folder or image
  std::optional<BlackBackground> black;  ///< makes masks from the images
  take::FrameRange frames;
  double rate_hz = 0;  ///< 0: that of the videos, otherwise 25
};

struct ImportResult {
  int64_t frames = 0;
  std::vector<std::string> cameras;
  double rate_hz = 0;
};

/// Throws InputError for bad input; then no take is created.
ImportResult import_take(const ImportOptions& options);

/// Parses "LEVEL" or "LEVEL:GROW:SHRINK": level 0 to 1, radii of dilation and erosion 0 to 100
/// pixels. Throws InputError for other text.
BlackBackground parse_black_background(std::string_view text);

}  // namespace v3d::ctl
