#include <gtest/gtest.h>

#include <random>

#include "recon/hull/brick_halo.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

int number_at(const BrickCounts& counts, int voxel) {
  int number = 0;
  for (size_t k = 0; k < counts.bit.size(); ++k) {
    number |= static_cast<int>(counts.bit[k][voxel / 64] >> (voxel % 64) & 1) << k;
  }
  return number;
}

BrickCounts counts_of(const SparseVolume& volume, size_t brick) {
  return neighbourhood_counts(bricks_around(volume, brick),
                              [&](size_t b, int z) { return volume.bricks()[b][z]; });
}

TEST(BrickCounts, count_the_27_voxels_in_and_round_each_across_the_faces_of_bricks) {
  std::mt19937 random(5);
  for (const unsigned in_ten : {1U, 5U, 9U, 10U}) {  // 10: all, so that 27 occurs
    const SparseVolume volume =
        make_volume(small_grid(29, 27, 31), [&](int, int, int) { return random() % 10 < in_ten; });
    for (size_t b = 0; b < volume.bricks().size(); ++b) {
      const BrickCounts counts = counts_of(volume, b);
      const codec::BrickCoord at = volume.coords()[b];
      for (int n = 0; n < 512; ++n) {
        const int i = 8 * at.x + n % 8, j = 8 * at.y + n / 8 % 8, k = 8 * at.z + n / 64;
        int expected = 0;
        for (int m = 0; m < 27; ++m) {
          expected += volume.get(i + m % 3 - 1, j + m / 3 % 3 - 1, k + m / 9 - 1);
        }
        ASSERT_EQ(number_at(counts, n), expected) << i << " " << j << " " << k;
      }
    }
  }
}

TEST(BrickCounts, larger_compares_voxel_by_voxel) {
  std::mt19937_64 random(6);
  BrickCounts a, b;
  for (size_t k = 0; k < a.bit.size(); ++k) {
    for (size_t z = 0; z < codec::kBrickEdge; ++z) {
      a.bit[k][z] = random();
      b.bit[k][z] = k < 2 ? random() : a.bit[k][z];  // most differ by little, some not at all
    }
  }
  const codec::Brick more = larger(a, b);
  for (int n = 0; n < 512; ++n) {
    EXPECT_EQ((more[n / 64] >> (n % 64) & 1) != 0, number_at(a, n) > number_at(b, n));
  }
}

}  // namespace
}  // namespace v3d::recon
