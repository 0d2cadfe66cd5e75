#include "daemon/control/packed_numbers.h"

#include <sodium.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <span>

namespace v3d::control {
namespace {

constexpr std::string_view kBits = "bits ";
constexpr int kBase64 = sodium_base64_VARIANT_ORIGINAL;
constexpr int64_t kMaxNumber = std::numeric_limits<int64_t>::max();

std::string pack_runs(const std::vector<int64_t>& numbers) {
  std::string text;
  for (size_t first = 0, last = 0; first < numbers.size(); first = last + 1) {
    last = first;
    while (last + 1 < numbers.size() && numbers[last] < kMaxNumber &&
           numbers[last + 1] == numbers[last] + 1) {
      ++last;
    }
    if (!text.empty()) text += ' ';
    text += std::to_string(numbers[first]);
    if (last > first) text += ':' + std::to_string(numbers[last]);
  }
  return text;
}

/// Requires ascending numbers. Empty when the text would not be shorter than `limit`.
std::optional<std::string> pack_bits(const std::vector<int64_t>& numbers, size_t limit) {
  if (numbers.empty()) return std::nullopt;
  const auto first = static_cast<uint64_t>(numbers.front());
  const uint64_t range = static_cast<uint64_t>(numbers.back()) - first;
  if (range / 8 >= limit) return std::nullopt;
  std::vector<uint8_t> bytes(range / 8 + 1);
  for (const int64_t number : numbers) {
    const uint64_t bit = static_cast<uint64_t>(number) - first;
    bytes[bit / 8] = static_cast<uint8_t>(bytes[bit / 8] | 1U << bit % 8);
  }
  std::string digits(sodium_base64_encoded_len(bytes.size(), kBase64), '\0');
  sodium_bin2base64(digits.data(), digits.size(), bytes.data(), bytes.size(), kBase64);
  digits.pop_back();  // the terminating zero
  std::string text = std::string(kBits) + std::to_string(numbers.front()) + " " + digits;
  return text.size() < limit ? std::optional(std::move(text)) : std::nullopt;
}

/// Reads a number at the start of `text`, and removes it. Empty where there is none.
std::optional<int64_t> consume_number(std::string_view& text) {
  int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return number;
}

bool consume_char(std::string_view& text, char expected) {
  if (!text.starts_with(expected)) return false;
  text.remove_prefix(1);
  return true;
}

std::optional<std::vector<int64_t>> unpack_runs(std::string_view text, size_t limit) {
  std::vector<int64_t> numbers;
  while (!text.empty()) {
    if (!numbers.empty() && !consume_char(text, ' ')) return std::nullopt;
    const auto first = consume_number(text);
    const auto last = consume_char(text, ':') ? consume_number(text) : first;
    if (!first || !last || *last < *first) return std::nullopt;
    const uint64_t further = static_cast<uint64_t>(*last) - static_cast<uint64_t>(*first);
    if (further >= limit - numbers.size()) return std::nullopt;
    for (uint64_t n = 0; n <= further; ++n) numbers.push_back(*first + static_cast<int64_t>(n));
  }
  return numbers;
}

std::optional<std::vector<int64_t>> unpack_bits(std::string_view text, size_t limit) {
  const auto first = consume_number(text);
  if (!first || !consume_char(text, ' ')) return std::nullopt;
  std::vector<uint8_t> bytes(text.size() / 4 * 3 + 3);
  size_t size = 0;
  const int failed = sodium_base642bin(bytes.data(), bytes.size(), text.data(), text.size(),
                                       nullptr, &size, nullptr, kBase64);
  if (failed != 0) return std::nullopt;
  const uint64_t last_bit = static_cast<uint64_t>(kMaxNumber) - static_cast<uint64_t>(*first);
  std::vector<int64_t> numbers;
  for (size_t bit = 0; bit < 8 * size; ++bit) {
    if ((bytes[bit / 8] >> bit % 8 & 1) == 0) continue;
    if (numbers.size() == limit || bit > last_bit) return std::nullopt;
    numbers.push_back(*first + static_cast<int64_t>(bit));
  }
  return numbers;
}

}  // namespace

std::string pack_numbers(const std::vector<int64_t>& numbers) {
  std::string runs = pack_runs(numbers);
  const bool ascend =
      std::ranges::adjacent_find(numbers, std::ranges::greater_equal()) == numbers.end();
  auto bits = ascend ? pack_bits(numbers, runs.size()) : std::nullopt;
  return bits ? *std::move(bits) : runs;
}

std::optional<std::vector<int64_t>> unpack_numbers(std::string_view text, size_t limit) {
  if (!text.starts_with(kBits)) return unpack_runs(text, limit);
  return unpack_bits(text.substr(kBits.size()), limit);
}

}  // namespace v3d::control
