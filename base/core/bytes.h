// Byte order and checksums.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <vector>

namespace v3d {

// XXH3 checksums (64 bits), which detect damage on the way to a disk and back. They cost less than
// the copy. The adapter of xxHash.

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

// Reads and writes unsigned integers in big-endian byte order, for LCM messages and logs, PTP and
// chrony.

/// The number in `bytes`, most significant byte first; 0 of no bytes.
/// Requires at most 8 bytes.
constexpr uint64_t read_big_endian(std::span<const uint8_t> bytes) {
  uint64_t value = 0;
  for (const uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

/// Writes the lowest 8 * to.size() bits of `value`, most significant byte first.
/// Requires at most 8 bytes.
constexpr void write_big_endian(uint64_t value, std::span<uint8_t> to) {
  for (size_t i = to.size(); i > 0; --i, value >>= 8) to[i - 1] = static_cast<uint8_t>(value);
}

/// Appends the lowest `size` bytes of `value`, most significant byte first. Requires size <= 8.
constexpr void put_big_endian(std::vector<uint8_t>& bytes, uint64_t value, size_t size) {
  bytes.resize(bytes.size() + size);
  write_big_endian(value, std::span(bytes).last(size));
}

}  // namespace v3d
