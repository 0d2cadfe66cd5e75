// Lengths as people write them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace v3d {

/// Removes a finite number from the front of `text`. Returns false, and changes nothing, when
/// `text` does not begin with one.
bool take_number(std::string_view& text, double& value);
/// "8mm", "0.5cm", "2m" to metres. Throws InputError for anything else; a bare number is refused.
double parse_length(std::string_view text);
/// The shortest fitting unit: "8 mm", "1.5 m".
std::string format_length(double metres);
/// "29.5 GB" (powers of 1000).
std::string format_bytes(double bytes);
/// "1,250".
std::string format_count(int64_t n);

}  // namespace v3d
