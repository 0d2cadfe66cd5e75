// Bytes as hexadecimal digits, and back. The adapter of libsodium's conversions, which take the
// same time for all contents of one length.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace v3d {

/// Two lower-case digits for each byte.
std::string hexadecimal(std::span<const uint8_t> bytes);
/// The same for secrets, into the caller's memory. `digits` has two places for each byte, and one
/// more, which becomes 0.
void write_hexadecimal(std::span<const uint8_t> bytes, std::span<uint8_t> digits);

/// Whether `text` has exactly two digits for each of `bytes`; fills them.
[[nodiscard]] bool parse_hexadecimal(std::string_view text, std::span<uint8_t> bytes);

}  // namespace v3d
