// Reader of fuzzer input: takes numbers and texts from the front.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>

namespace v3d::test {

/// Reports a finding (aborts) when a condition of the target does not hold.
inline void must(bool condition) {
  if (!condition) std::abort();
}

class FuzzInput {
 public:
  FuzzInput(const uint8_t* data, size_t size) : remaining_(data, size) {}

  bool empty() const { return remaining_.empty(); }
  /// At most `max_size` bytes, fewer at the end.
  std::span<const uint8_t> bytes(size_t max_size) {
    const size_t size = std::min(max_size, remaining_.size());
    const auto taken = remaining_.first(size);
    remaining_ = remaining_.subspan(size);
    return taken;
  }
  /// The next number of type N; 0 at the end. A partial number is filled with zeros.
  template <class N>
  N number() {
    N n{};
    const auto taken = bytes(sizeof n);
    if (!taken.empty()) std::memcpy(&n, taken.data(), taken.size());
    return n;
  }
  /// The next text of at most 255 bytes, after its length (u8).
  std::string text() {
    const auto taken = bytes(number<uint8_t>());
    return {taken.begin(), taken.end()};
  }
  /// All remaining bytes.
  std::string rest() {
    const auto taken = bytes(remaining_.size());
    return {taken.begin(), taken.end()};
  }

 private:
  std::span<const uint8_t> remaining_;
};

}  // namespace v3d::test
