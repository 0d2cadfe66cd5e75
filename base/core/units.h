// Parses and formats lengths, boxes, byte counts and numbers for command lines and reports.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace v3d {

/// Parses a finite number at the start of `text` and removes it. Returns false, and changes
/// nothing, when `text` does not begin with one.
bool take_number(std::string_view& text, double& value);
/// Parses "8mm", "0.5cm" or "2m" to metres. Throws InputError for anything else, including a number
/// without a unit.
double parse_length(std::string_view text);
/// A length in millimetres below 1 m, else in metres: "8 mm", "1.5 m".
std::string format_length(double metres);
/// "29.5 GB" (powers of 1000).
std::string format_bytes(double bytes);
/// "1,250".
std::string format_count(int64_t n);

}  // namespace v3d
