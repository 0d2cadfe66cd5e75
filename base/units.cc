#include "base/units.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "base/error.h"

namespace v3d {
namespace {

/// Parses a finite number at the start of `text` and removes it. False when there is none.
bool take_number(std::string_view& text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || !std::isfinite(value)) {
    return false;
  }
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return true;
}

std::string with_unit(double value, const char* unit) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g %s", value, unit);
  return text.data();
}

}  // namespace

double parse_length(std::string_view text) {
  std::string_view rest = text;
  double value = 0;
  if (take_number(rest, value) && value > 0) {
    if (rest == "mm") return value * 1e-3;
    if (rest == "cm") return value * 1e-2;
    if (rest == "m") return value;
  }
  throw InputError("length '" + std::string(text) +
                   "': expected a positive number with a unit, like 8mm, 0.5cm or 2m");
}

Box parse_bounds(std::string_view text) {
  std::array<double, 6> v{};
  std::string_view rest = text;
  bool good = true;
  for (size_t i = 0; i < v.size() && good; ++i) {
    good = take_number(rest, v[i]);
    if (good && i + 1 < v.size()) {
      good = rest.starts_with(',');
      rest.remove_prefix(good ? 1 : 0);
    }
  }
  if (!good || !rest.empty() || v[0] >= v[3] || v[1] >= v[4] || v[2] >= v[5]) {
    throw InputError("bounds '" + std::string(text) +
                     "': expected X0,Y0,Z0,X1,Y1,Z1 in metres, with X0 < X1, Y0 < Y1 and Z0 < Z1");
  }
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

std::string format_length(double metres) {
  return std::abs(metres) < 1 ? with_unit(metres * 1e3, "mm") : with_unit(metres, "m");
}

std::string format_bytes(double bytes) {
  static constexpr std::array<const char*, 6> kUnits = {"B", "kB", "MB", "GB", "TB", "PB"};
  size_t unit = 0;
  for (; bytes >= 1000 && unit + 1 < kUnits.size(); ++unit) {
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
