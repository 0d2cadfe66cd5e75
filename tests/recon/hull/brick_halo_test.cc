#include "recon/hull/brick_halo.h"

#include <gtest/gtest.h>

#include <random>

#include "base/geometry/mesh.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

TEST(BrickHalo, sums_over_the_27_voxels_in_and_round_each_across_the_borders_of_bricks) {
  std::mt19937 random(9);
  // Bricks without a voxel are not stored: there are holes.
  const SparseVolume volume = make_volume(small_grid(30, 20, 25), [&](int i, int j, int k) {
    return (i / 8 + j / 8 + k / 8) % 3 != 0 && random() % 3 == 0;
  });
  std::vector<std::array<uint32_t, 512>> numbers(volume.bricks().size());
  for (auto& brick : numbers) {
    for (uint32_t& number : brick) number = random() % 1000;
  }
  const auto number_at = [&](int i, int j, int k) -> uint32_t {
    if (i < 0 || j < 0 || k < 0) return 0;
    const int brick = volume.index_of({i / 8, j / 8, k / 8});
    return brick < 0 ? 0 : numbers[brick][64 * (k % 8) + 8 * (j % 8) + i % 8];
  };
  for (size_t b = 0; b < numbers.size(); ++b) {
    const auto row_of = [&](size_t brick, int row) {
      BrickRow<uint32_t> values;
      std::copy_n(numbers[brick].begin() + 8 * row, 8, values.begin());
      return values;
    };
    const auto sums = neighbourhood_sums<uint32_t>(bricks_around(volume, b), row_of);
    const codec::BrickCoord at = volume.coords()[b];
    for (int n = 0; n < 512; ++n) {
      const int i = 8 * at.x + n % 8, j = 8 * at.y + n / 8 % 8, k = 8 * at.z + n / 64;
      uint32_t expected = 0;
      for (int m = 0; m < 27; ++m) {
        expected += number_at(i + m % 3 - 1, j + m / 3 % 3 - 1, k + m / 9 - 1);
      }
      ASSERT_EQ(sums[n], expected) << i << " " << j << " " << k;
    }
  }
}

TEST(VertexLattice, rounds_to_the_nearest_of_its_points) {
  const VertexLattice lattice{.origin = {0.1, -2, 0}, .step = 0.25};
  const Eigen::Vector3f rounded = rounded_to(lattice, {0.48F, -2.2F, 1e-3F});
  EXPECT_EQ(rounded, Eigen::Vector3f(static_cast<float>(0.1 + 2 * 0.25), -2.25F, 0));
}

TEST(VertexLattice, keeps_its_own_points) {
  std::mt19937 random(2);
  const VertexLattice lattice{.origin = {-1.37, 0.211, 0.05}, .step = 0.01 / 50};
  std::uniform_real_distribution<float> along(-2, 2);
  for (int n = 0; n < 10'000; ++n) {
    const Eigen::Vector3f position(along(random), along(random), along(random));
    const Eigen::Vector3f once = rounded_to(lattice, position);
    EXPECT_LE((once - position).cwiseAbs().maxCoeff(), 0.5F * 0.0002F + 3e-7F);
    EXPECT_EQ(rounded_to(lattice, once), once);
  }
}

}  // namespace
}  // namespace v3d::recon
