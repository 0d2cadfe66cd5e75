// All cameras on one picture. Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/mask.h"

namespace v3d::ctl {

struct SheetPicture {
  std::string name;
  std::optional<Image> image;  ///< RGB8; empty: nothing came
  std::optional<Mask> mask;    ///< of the image's size; its outline is drawn in
};

/// RGB8. The pictures in rows of about equal number, each below its name.
Image contact_sheet(const std::vector<SheetPicture>& pictures);

/// Writes `text` in letters of 10 x 14 pixels, in white; what is no letter, digit or one of
/// "-_.:/ " becomes a box. Parts outside of the image are left out.
void draw_text(Image& image, int x, int y, const std::string& text);

}  // namespace v3d::ctl
