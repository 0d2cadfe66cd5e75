#include "recon/performers/contact_motion.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <vector>

#include "recon/volumes.h"

namespace v3d::recon {
namespace {

TEST(ContactMotion, has_windows_with_the_voxels_at_any_position) {
  std::mt19937 random(1);
  const SparseVolume volume =
      make_volume(small_grid(29, 21, 26), [&](int, int, int) { return random() % 3 == 0; });
  for (int trial = 0; trial < 200; ++trial) {
    const auto any = [&](int count) { return static_cast<int>(random() % (count + 20)) - 10; };
    const VoxelStep lowest{any(29), any(21), any(26)};
    const codec::Brick window = window_at(volume, volume.bricks(), lowest);
    for (int n = 0; n < 512; ++n) {
      const bool expected =
          volume.get(lowest[0] + n % 8, lowest[1] + n / 8 % 8, lowest[2] + n / 64);
      ASSERT_EQ((window[n / 64] >> (n % 64) & 1) != 0, expected);
    }
  }
}

TEST(ContactMotion, is_the_step_of_a_body_that_moves) {
  for (const VoxelStep step : {VoxelStep{0, 0, 0}, {3, -5, 2}, {-7, 0, 1}, {4, 4, -6}}) {
    const auto body = [&](int i, int j, int k) {
      const int x = i - 30 - step[0], y = j - 30 - step[1], z = k - 30 - step[2];
      return x * x + 2 * y * y + z * z < 200 || (x > 0 && x < 20 && y * y + z * z < 12);
    };
    const auto before = [&](int i, int j, int k) {
      return body(i + step[0], j + step[1], k + step[2]);
    };
    const VoxelGrid grid = small_grid(64, 64, 64);
    const SparseVolume now = make_volume(grid, body), then = make_volume(grid, before);
    std::vector<uint32_t> block(now.bricks().size());
    std::iota(block.begin(), block.end(), 0);
    EXPECT_EQ(block_motion(now, then, block), step);
  }
}

}  // namespace
}  // namespace v3d::recon
