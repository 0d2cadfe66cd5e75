// Parses and formats image sizes of command-line options, such as 1024x768.
#pragma once

#include <string>
#include <string_view>

#include "base/image/image.h"

namespace v3d {

/// The sides that parse_size() accepts.
enum class Sides {
  kAny,
  kEven,  ///< even numbers only: a Bayer mosaic has tiles of 2x2 pixels
};

/// Parses "1024x768": width and height in pixels, each from 16 to kMaxImageSide.
/// Throws InputError; the message starts with `option`.
ImageSize parse_size(std::string_view text, Sides sides = Sides::kAny,
                     std::string_view option = "--size");

/// "1024x768", for any size.
std::string format_size(ImageSize size);

}  // namespace v3d
