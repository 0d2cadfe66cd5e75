#include "base/core/name.h"

#include <algorithm>
#include <cstddef>

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

}  // namespace v3d
