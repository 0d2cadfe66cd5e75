#include "base/image/image_size.h"

#include <charconv>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr int kMinSide = 16;

/// Parses an integer at the start of `text` and removes it. False when there is none.
bool take_number(std::string_view& text, int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return error == std::errc{};
}

bool is_side(int pixels, Sides sides) {
  return pixels >= kMinSide && pixels <= kMaxImageSide && (sides == Sides::kAny || pixels % 2 == 0);
}

}  // namespace

ImageSize parse_size(std::string_view text, Sides sides, std::string_view option) {
  std::string_view rest = text;
  ImageSize size;
  bool good = take_number(rest, size.width) && rest.starts_with('x');
  if (good) rest.remove_prefix(1);
  good = good && take_number(rest, size.height) && rest.empty() && is_side(size.width, sides) &&
         is_side(size.height, sides);
  if (good) return size;
  throw InputError(std::string(option) + " " + std::string(text) + ": expected WIDTHxHEIGHT, " +
                   (sides == Sides::kEven ? "even " : "") + "numbers of pixels from " +
                   std::to_string(kMinSide) + " to " + std::to_string(kMaxImageSide) +
                   ", like 1024x768");
}

std::string format_size(ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace v3d
