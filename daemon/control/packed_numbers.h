// Packed text of long lists of pulse numbers, for replies: the channel of replies limits their
// length.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::control {

/// Packs numbers without loss, in the shorter one of two forms: runs of consecutive numbers,
/// "0:215999 300000" (first and last number of a run; one number alone), or a bit for each number
/// of a range, "bits 17 <base64>" (its first number; the lowest bit of a byte is first).
///
/// Ascending numbers of a range of n take at most n / 6 + 30 characters. Any order is permitted,
/// but then only runs are written.
std::string pack_numbers(const std::vector<int64_t>& numbers);

/// The numbers of a packed text. Empty for another text, and when there are more than `limit`
/// numbers: a short text can name any number of them.
std::optional<std::vector<int64_t>> unpack_numbers(std::string_view text, size_t limit);

}  // namespace v3d::control
