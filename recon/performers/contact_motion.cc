#include "recon/performers/contact_motion.h"

namespace v3d::recon {
namespace {

constexpr uint64_t kEachRow = 0x0101010101010101;
constexpr size_t kMaxCompared = 48;

int64_t difference(const SparseVolume& volume, const SparseVolume& previous,
                   std::span<const uint32_t> block, const VoxelStep& step) {
  const size_t every = (block.size() + kMaxCompared - 1) / kMaxCompared;
  int64_t differing = 0;
  for (size_t n = 0; n < block.size(); n += every) {
    const codec::BrickCoord at = volume.coords()[block[n]];
    const codec::Brick before = window_at(previous, previous.bricks(), moved_back(at, step));
    for (size_t z = 0; z < before.size(); ++z)
      differing += codec::bit_count(before[z] ^ volume.bricks()[block[n]][z]);
  }
  return differing;
}

}  // namespace

codec::Brick window_at(const SparseVolume& volume, std::span<const codec::Brick> set,
                       const VoxelStep& lowest) {
  // Masks and right shifts round down, also for negative numbers.
  const int x = lowest[0] & 7, y = lowest[1] & 7, z = lowest[2] & 7;
  std::array<const codec::Brick*, 8> corner{};
  for (int n = 0; n < 8; ++n) {
    const int index = volume.index_of(
        {(lowest[0] >> 3) + n % 2, (lowest[1] >> 3) + n / 2 % 2, (lowest[2] >> 3) + n / 4});
    corner[n] = index < 0 ? &codec::kEmptyBrick : &set[index];
  }
  const uint64_t low = kEachRow * (0xFFU >> x);
  const auto along_y = [&](uint64_t first, uint64_t second) {
    return y == 0 ? first : first >> 8 * y | second << (64 - 8 * y);
  };
  codec::Brick window{};
  for (int k = 0; k < codec::kBrickEdge; ++k) {
    const auto layer = [&](int n) { return (*corner[n + 4 * ((z + k) >> 3)])[(z + k) & 7]; };
    const uint64_t first = along_y(layer(0), layer(2));
    const uint64_t second = along_y(layer(1), layer(3));
    window[k] = (first >> x & low) | (second << (8 - x) & ~low);
  }
  return window;
}

VoxelStep block_motion(const SparseVolume& volume, const SparseVolume& previous,
                       std::span<const uint32_t> block) {
  VoxelStep best{};
  int64_t least = difference(volume, previous, block, best);
  for (int step = 4; step >= 1; step /= 2) {
    const VoxelStep middle = best;
    for (int n = 0; n < 27; ++n) {
      const VoxelStep tried{middle[0] + step * (n % 3 - 1), middle[1] + step * (n / 3 % 3 - 1),
                            middle[2] + step * (n / 9 - 1)};
      if (tried == middle) continue;
      const int64_t differing = difference(volume, previous, block, tried);
      if (differing < least) {
        least = differing;
        best = tried;
      }
    }
  }
  return best;
}

}  // namespace v3d::recon
