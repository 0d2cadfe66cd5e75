// XXH3 checksums (64 bits), which detect damage on the way to a disk and back. They cost less than
// the copy. The adapter of xxHash.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>

namespace v3d {

/// XXH3 (64 bits, seed 0) of the concatenated parts.
uint64_t checksum(std::initializer_list<std::span<const uint8_t>> parts);

/// Computes checksum() incrementally, for bytes that arrive in pieces, such as those of a long
/// file. Use from one thread.
class RunningChecksum {
 public:
  RunningChecksum();

  void add(std::span<const uint8_t> bytes);
  /// The checksum of all bytes added so far. More bytes may follow.
  uint64_t value() const;

 private:
  std::unique_ptr<void, void (*)(void*)> state_;  ///< XXH3_state_t
};

}  // namespace v3d
