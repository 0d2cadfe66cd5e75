// Images as files, through OpenCV: the only place of the tools that sees it.
#pragma once

#include <filesystem>

#include "base/image.h"
#include "base/mask.h"

namespace v3d::ctl {

/// RGB8, eight bits a channel, as the pixels lie in the file: an EXIF orientation is ignored, since
/// a calibration belongs to the sensor. Throws InputError when the file is missing, no image, or
/// truncated.
Image read_image(const std::filesystem::path& path);

/// Foreground where the grey value is 128 or more. Throws as read_image().
Mask read_mask(const std::filesystem::path& path);

/// The subject before a black background: foreground is brighter than `level` (the greatest of red,
/// green and blue, 0..1), then grown and shrunk by discs of so many pixels, which closes dark spots
/// and errs towards too much rather than too little.
struct BlackBackground {
  double level = 0;
  int grow_px = 0;
  int shrink_px = 0;
};
/// Requires format RGB8.
Mask mask_before_black(ImageView image, const BlackBackground& black);

/// File names that read_image() is tried on: .png .jpg .jpeg .bmp .tif .tiff .ppm .pgm .webp
bool has_image_name(const std::filesystem::path& path);

}  // namespace v3d::ctl
