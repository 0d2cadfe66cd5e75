// Conversion of bytes to hexadecimal digits and back. Adapter of the conversions of libsodium,
// which take constant time for a given length.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace v3d {

/// Two lower-case digits for each byte.
std::string hexadecimal(std::span<const uint8_t> bytes);
/// The same for secrets, into memory of the caller. `digits` has two places for each byte and one
/// more, which becomes 0.
void write_hexadecimal(std::span<const uint8_t> bytes, std::span<uint8_t> digits);

/// Fills `bytes`. False when `text` does not have exactly two digits for each byte.
[[nodiscard]] bool parse_hexadecimal(std::string_view text, std::span<uint8_t> bytes);

}  // namespace v3d
