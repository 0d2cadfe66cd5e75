#include "base/core/text.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/core/error.h"

namespace v3d {
namespace {

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

}  // namespace

bool is_file_name(std::string_view name) {
  constexpr size_t kMaxLength = 64;
  return !name.empty() && name.size() <= kMaxLength && name.front() != '.' && name.front() != '-' &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return is_letter_or_digit(c) || c == '-' || c == '_' || c == '.';
         });
}

bool is_camera_name(std::string_view name) {
  constexpr size_t kSegmentDigits = 4;
  if (!is_file_name(name) || name == "pulses") return false;
  const size_t dot = name.rfind('.');
  if (dot == std::string_view::npos || name.size() - dot - 1 != kSegmentDigits) return true;
  return !std::all_of(name.begin() + static_cast<ptrdiff_t>(dot) + 1, name.end(),
                      [](char c) { return c >= '0' && c <= '9'; });
}

std::string join_names(const std::vector<std::string>& names) {
  constexpr size_t kMaxNames = 24;
  std::string joined;
  for (size_t i = 0; i < std::min(names.size(), kMaxNames); ++i)
    joined += (i ? ", " : "") + names[i];
  if (names.size() > kMaxNames) joined += ", ...";
  return joined;
}

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

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const size_t size = character_size(text);
    if (size == 0) return false;
    text.remove_prefix(size);
  }
  return true;
}

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

std::string printable_text(std::string_view text) {
  std::string result;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    result += printable(text.substr(begin, end - begin));
    if (end < text.size()) result += '\n';
    begin = end + 1;
  }
  return result;
}

namespace {

constexpr char kStyle[] = R"(<style>
body { font: 15px/1.45 sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em; color: #222; }
table { border-collapse: collapse; } th, td { padding: .2em .8em; text-align: right; }
th { border-bottom: 1px solid #888; } td:first-child, th:first-child { text-align: left; }
figure { margin: 0; } figcaption { font-size: 90%; } li { margin: .2em 0; }
svg { background: #f4f4f4; border: 1px solid #ccc; }
.row { display: flex; flex-wrap: wrap; gap: 1em; margin: .5em 0 1.5em; }
.row img { display: block; max-width: 100%; border-radius: 3px; }
.beside { display: grid; grid-auto-flow: column; grid-auto-columns: minmax(0, 1fr); gap: 1em; margin: .5em 0 1em; }
.beside img { display: block; width: 100%; border-radius: 3px; }
.note { color: #555; max-width: 50em; }
.scale { height: .9em; width: 24em; border-radius: 3px; }
.marks { display: flex; justify-content: space-between; width: 24em; }
.marks span { display: flex; justify-content: center; width: 0; font-size: 85%; white-space: nowrap; }
</style>)";

}  // namespace

std::string html_escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '<') {
      result += "&lt;";
    } else if (c == '&') {
      result += "&amp;";
    } else {
      result += c;
    }
  }
  return result;
}

std::string html_head(std::string_view title) {
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" +
         html_escaped(title) + "</title>\n" + kStyle + "</head><body>\n";
}

namespace {

/// Numbers from here on have more than three digits when they are rounded to three.
constexpr double kFourDigits = 999.5;

std::string with_unit(double value, const char* unit) {
  return std::abs(value) < kFourDigits ? fmt::format("{:.3g} {}", value, unit)
                                       : fmt::format("{:.0f} {}", value, unit);
}

}  // namespace

bool consume_number(std::string_view& text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || !std::isfinite(value)) {
    return false;
  }
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return true;
}

double parse_length(std::string_view text) {
  std::string_view rest = text;
  double value = 0;
  if (consume_number(rest, value) && value > 0) {
    if (rest == "mm") return value * 1e-3;
    if (rest == "cm") return value * 1e-2;
    if (rest == "m") return value;
  }
  throw InputError("length '" + std::string(text) +
                   "': expected a positive number with a unit, like 8mm, 0.5cm or 2m");
}

std::string format_length(double metres) {
  const double millimetres = metres * 1e3;
  return std::abs(millimetres) < kFourDigits ? with_unit(millimetres, "mm")
                                             : with_unit(metres, "m");
}

std::string format_bytes(double bytes) {
  static constexpr std::array<const char*, 6> kUnits = {"B", "kB", "MB", "GB", "TB", "PB"};
  size_t unit = 0;
  for (; bytes >= kFourDigits && unit + 1 < kUnits.size(); ++unit) {
    bytes /= 1000;
  }
  return with_unit(bytes, kUnits[unit]);
}

std::string format_count(int64_t n) {
  std::string text = std::to_string(n);
  const int first_digit = n < 0 ? 1 : 0;
  for (int at = static_cast<int>(text.size()) - 3; at > first_digit; at -= 3) {
    text.insert(static_cast<size_t>(at), ",");
  }
  return text;
}

}  // namespace v3d
