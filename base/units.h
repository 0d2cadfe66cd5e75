// Parses and formats lengths, boxes, byte counts and numbers for command lines and reports.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/geometry.h"

namespace v3d {

/// Parses "8mm", "0.5cm" or "2m" to metres. Throws InputError for anything else, including a number
/// without a unit.
double parse_length(std::string_view text);
/// Parses "X0,Y0,Z0,X1,Y1,Z1" in metres. Throws InputError unless X0 < X1, Y0 < Y1 and Z0 < Z1.
Box parse_bounds(std::string_view text);
/// A length in millimetres below 1 m, else in metres: "8 mm", "1.5 m".
std::string format_length(double metres);
/// "29.5 GB" (powers of 1000).
std::string format_bytes(double bytes);
/// "1,250".
std::string format_count(int64_t n);

}  // namespace v3d
