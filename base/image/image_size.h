// Sizes of images as people write them.
#pragma once

#include <string>
#include <string_view>

#include "base/image/image.h"

namespace v3d {

/// Sides of an image that may be asked for.
enum class Sides {
  kAny,
  kEven,  ///< a filter mosaic is 2x2
};

/// "1024x768": width and height in pixels, from 16 to kMaxImageSide each. `option` begins the
/// message. Throws InputError.
ImageSize parse_size(std::string_view text, Sides sides = Sides::kAny,
                     std::string_view option = "--size");

/// The same, of any size.
std::string format_size(ImageSize size);

}  // namespace v3d
