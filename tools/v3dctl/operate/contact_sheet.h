// Contact sheet: the images of all cameras on one picture. Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::ctl {

struct SheetImage {
  std::string name;
  std::optional<Image> image;  ///< RGB8; empty: no image was received
  std::optional<Mask> mask;    ///< its outline is drawn; ignored if its size differs from the image
};

/// Arranges the images in a nearly square grid, each below its name. Result: RGB8.
Image contact_sheet(const std::vector<SheetImage>& images);

/// Draws white text in letters of 10 x 14 pixels, clipped to the image. (x, y): upper left corner.
/// Characters other than letters, digits, spaces and "-_.:/" become boxes.
void draw_text(Image& image, int x, int y, const std::string& text);

}  // namespace v3d::ctl
