#include "base/core/printable.h"

#include <cstdint>

namespace v3d {
namespace {

/// Length in bytes of the character at the start of `text` (table 3-7 of the Unicode standard); 0
/// when it is not valid UTF-8.
size_t character_size(std::string_view text) {
  const auto byte = [&](size_t i) { return i < text.size() ? static_cast<uint8_t>(text[i]) : 0; };
  const auto is_in_range = [&](size_t i, int low, int high) {
    return byte(i) >= low && byte(i) <= high;
  };
  const int first = byte(0);
  if (first < 0x80) return 1;
  if (first >= 0xC2 && first <= 0xDF) return is_in_range(1, 0x80, 0xBF) ? 2 : 0;
  if (first >= 0xE0 && first <= 0xEF) {
    const int low = first == 0xE0 ? 0xA0 : 0x80;
    const int high = first == 0xED ? 0x9F : 0xBF;
    return is_in_range(1, low, high) && is_in_range(2, 0x80, 0xBF) ? 3 : 0;
  }
  if (first >= 0xF0 && first <= 0xF4) {
    const int low = first == 0xF0 ? 0x90 : 0x80;
    const int high = first == 0xF4 ? 0x8F : 0xBF;
    return is_in_range(1, low, high) && is_in_range(2, 0x80, 0xBF) && is_in_range(3, 0x80, 0xBF)
               ? 4
               : 0;
  }
  return 0;
}

/// Control characters: C0, DEL and C1.
bool is_control(std::string_view character) {
  const auto first = static_cast<uint8_t>(character[0]);
  return first < 0x20 || first == 0x7F ||
         (first == 0xC2 && static_cast<uint8_t>(character[1]) < 0xA0);
}

}  // namespace

std::string printable(std::string_view text) {
  std::string clean;
  while (!text.empty()) {
    const size_t size = character_size(text);
    const std::string_view character = text.substr(0, size > 0 ? size : 1);
    const bool is_printable = size > 0 && !is_control(character);
    clean += is_printable ? character : "?";
    text.remove_prefix(character.size());
  }
  return clean;
}

}  // namespace v3d
