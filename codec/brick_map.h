// Set of bricks on a lattice, one bit each, with consecutive numbers of the bricks in the set.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d {

/// Brick (x, y, z) holds voxels 8x .. 8x+7, 8y .. 8y+7, 8z .. 8z+7.
struct BrickCoord {
  int x = 0;
  int y = 0;
  int z = 0;
  friend bool operator==(const BrickCoord&, const BrickCoord&) = default;
};

/// Number of set bits. Baseline x86-64 has no instruction for it, and std::popcount() is a function
/// call there.
constexpr int bit_count(uint64_t x) {
  x -= x >> 1 & 0x5555555555555555;
  x = (x & 0x3333333333333333) + (x >> 2 & 0x3333333333333333);
  x = (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0F;
  return static_cast<int>(x * 0x0101010101010101 >> 56);
}

/// A set of bricks. One thread fills it, or several threads that write different rows. Any thread
/// reads it.
class BrickMap {
 public:
  static constexpr int kBitsPerWord = 64;

  /// Empties the set and sets its range to 0 <= x < counts[0] and so on. Keeps its memory.
  void clear(const std::array<int, 3>& counts);

  const std::array<int, 3>& counts() const { return counts_; }
  bool inside(BrickCoord at) const {
    return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < counts_[0] && at.y < counts_[1] &&
           at.z < counts_[2];
  }

  /// Brick x is bit x % 64 of word x / 64; bits from counts()[0] on stay 0. Requires a row inside.
  std::span<uint64_t> row(int y, int z) { return {&bits_[word_of({0, y, z})], words_per_row()}; }
  std::span<const uint64_t> row(int y, int z) const {
    return {&bits_[word_of({0, y, z})], words_per_row()};
  }
  /// The word that holds the bit of the brick, for writers that share a row. Requires inside().
  uint64_t& word(BrickCoord at) { return bits_[word_of(at)]; }
  static uint64_t bit(BrickCoord at) { return uint64_t{1} << (at.x % kBitsPerWord); }

  /// Numbers the bricks by z, then y, then x, from 0. Returns their count.
  int number();
  /// The number of the brick; -1 when it is not in the set. Requires number() after the last
  /// change.
  int index_of(BrickCoord at) const {
    if (!inside(at)) return -1;
    const size_t w = word_of(at);
    return (bits_[w] & bit(at)) != 0 ? first_[w] + bit_count(bits_[w] & (bit(at) - 1)) : -1;
  }

 private:
  size_t words_per_row() const { return static_cast<size_t>(words_per_row_); }
  size_t word_of(BrickCoord at) const {
    return (static_cast<size_t>(at.z) * counts_[1] + at.y) * words_per_row_ + at.x / kBitsPerWord;
  }

  std::array<int, 3> counts_{};
  int words_per_row_ = 0;
  std::vector<uint64_t> bits_;
  std::vector<int32_t> first_;  ///< number of the first brick of each word
};

}  // namespace v3d
