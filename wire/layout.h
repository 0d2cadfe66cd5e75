// The lengths in an LCM message, checked before the generated decoder trusts them: it resizes its
// vectors to whatever a message says, before it looks whether the bytes are there.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace v3d {

/// A message type's fields in order, one letter each:
///   q 8 bytes   i 4 bytes   b 1 byte   ? boolean   s string   n int32 count of an array below
///   m 32 bytes
///   B bytes[count]   S strings[count]   D 8-byte numbers[count]
/// Arrays name their count by its position among the n's, from 0: "B0", "S1".
using Layout = std::string_view;

/// True when `body` (what follows the 8-byte fingerprint) is exactly such a message: every length
/// is at least 0 and inside the body, every string ends with its only NUL, every boolean is 0 or 1,
/// nothing is left over.
bool fits(Layout layout, std::span<const uint8_t> body);

/// The number of bytes from the start of `body` to the first byte array (letter B), by the same
/// rules; empty when the bytes are not right or not there.
std::optional<size_t> bytes_before_arrays(Layout layout, std::span<const uint8_t> body);

}  // namespace v3d
