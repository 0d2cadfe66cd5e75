// Lengths as people write them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/geometry.h"

namespace v3d {

/// "8mm", "0.5cm", "2m" to metres. Throws InputError for anything else; a bare number is refused.
double parse_length(std::string_view text);
/// "X0,Y0,Z0,X1,Y1,Z1" in metres, every X0 < X1. Throws InputError.
Box parse_bounds(std::string_view text);
/// The shortest fitting unit: "8 mm", "1.5 m".
std::string format_length(double metres);
/// "29.5 GB" (powers of 1000).
std::string format_bytes(double bytes);
/// "1,250".
std::string format_count(int64_t n);

}  // namespace v3d
