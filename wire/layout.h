// Check of the lengths in an LCM message before the generated decoder runs. That decoder resizes
// its vectors to any length in a message before it checks that the bytes exist.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace v3d {

/// The fields of a message type in order, one letter each:
///   q 8 bytes   i 4 bytes   b 1 byte   ? boolean   s string   n int32 count of an array below
///   m 32 bytes
///   B bytes[count]   S strings[count]   D 8-byte numbers[count]
/// A digit after an array selects its count: its position among the n's, from 0. Examples: "B0",
/// "S1".
using Layout = std::string_view;

/// True when `body` (the bytes after the 8-byte fingerprint) is exactly one such message. Every
/// length is at least 0 and inside the body, every string ends with its only NUL, and every boolean
/// is 0 or 1. No bytes are left over.
bool fits(Layout layout, std::span<const uint8_t> body);

/// The number of bytes from the start of `body` to the first byte array (letter B), by the same
/// rules. Empty when the bytes before it are invalid or incomplete.
std::optional<size_t> bytes_before_arrays(Layout layout, std::span<const uint8_t> body);

}  // namespace v3d
