// The bytes of a fuzzer, taken from the front as the numbers and texts that a target wants.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>

namespace v3d::test {

/// What a target holds to be true; a finding where it is not.
inline void must(bool condition) {
  if (!condition) std::abort();
}

class FuzzInput {
 public:
  FuzzInput(const uint8_t* data, size_t size) : left_(data, size) {}

  bool empty() const { return left_.empty(); }
  std::span<const uint8_t> bytes(size_t most) {
    const size_t size = std::min(most, left_.size());
    const auto taken = left_.first(size);
    left_ = left_.subspan(size);
    return taken;
  }
  /// N is a number; 0 where nothing is left.
  template <class N>
  N number() {
    N n{};
    const auto taken = bytes(sizeof n);
    if (!taken.empty()) std::memcpy(&n, taken.data(), taken.size());
    return n;
  }
  /// Of at most 255 bytes.
  std::string text() {
    const auto taken = bytes(number<uint8_t>());
    return {taken.begin(), taken.end()};
  }
  std::string rest() {
    const auto taken = bytes(left_.size());
    return {taken.begin(), taken.end()};
  }

 private:
  std::span<const uint8_t> left_;
};

}  // namespace v3d::test
