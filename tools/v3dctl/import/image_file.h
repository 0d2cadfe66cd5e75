// Readers of image files, through OpenCV. Only image_file.cc includes it here.
#pragma once

#include <filesystem>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::ctl {

/// Reads an image as RGB8. An EXIF orientation is ignored, because a calibration refers to the
/// sensor. Throws InputError for a file that is missing, truncated or no image.
Image read_image(const std::filesystem::path& path);

/// Reads a mask: foreground has grey values of 128 and more. Throws as read_image().
Mask read_mask(const std::filesystem::path& path);

/// Segmentation of a subject before a black background: foreground is brighter than `level`
/// (maximum of red, green and blue, 0 to 1). It is dilated and then eroded by discs, which closes
/// dark spots.
struct BlackBackground {
  double level = 0;
  int dilate_px = 0;  ///< radius
  int erode_px = 0;   ///< radius
};
/// Requires format RGB8.
Mask mask_before_black(ImageView image, const BlackBackground& black);

/// Whether read_image() supports the extension: .png .jpg .jpeg .bmp .tif .tiff .ppm .pgm .webp
bool has_image_name(const std::filesystem::path& path);

}  // namespace v3d::ctl
