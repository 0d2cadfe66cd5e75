// Checksums against damage on the way to a disk and back: XXH3 with 64 bits, which costs less than
// the copy. The adapter of xxHash.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>

namespace v3d {

/// XXH3, 64 bits, seed 0, of the parts as if they stood one behind the other.
uint64_t checksum(std::initializer_list<std::span<const uint8_t>> parts);

/// The same checksum of bytes that come one after the other, as those of a long file do. One
/// thread.
class RunningChecksum {
 public:
  RunningChecksum();

  void add(std::span<const uint8_t> bytes);
  /// Of all bytes until now; more may follow.
  uint64_t value() const;

 private:
  std::unique_ptr<void, void (*)(void*)> state_;  ///< XXH3_state_t
};

}  // namespace v3d
