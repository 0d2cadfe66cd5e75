#include "recon/hull/volume_components.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <vector>

#include "recon/volumes.h"

namespace v3d::recon {
namespace {

using Voxel = std::array<int, 3>;
using Voxels = std::set<Voxel>;

/// The components of a volume, as sets of voxels.
std::set<Voxels> found_in(const SparseVolume& volume) {
  VolumeComponents components;
  components.find(volume);
  std::set<Voxels> found;
  for (size_t c = 0; c < components.count(); ++c) {
    Voxels voxels;
    for (const ComponentPart& part : components.parts(c)) {
      const codec::BrickCoord at = volume.coords()[part.brick];
      for (int n = 0; n < 512; ++n) {
        if ((part.bits[n / 64] >> (n % 64) & 1) != 0)
          voxels.insert({8 * at.x + n % 8, 8 * at.y + n / 8 % 8, 8 * at.z + n / 64});
      }
    }
    EXPECT_EQ(components.voxels(c), static_cast<int64_t>(voxels.size()));
    found.insert(std::move(voxels));
  }
  return found;
}

/// Reference: one voxel at a time.
std::set<Voxels> expected_in(const SparseVolume& volume) {
  const auto& counts = volume.grid().counts;
  Voxels left;
  for (int k = 0; k < counts[2]; ++k) {
    for (int j = 0; j < counts[1]; ++j) {
      for (int i = 0; i < counts[0]; ++i) {
        if (volume.get(i, j, k)) left.insert({i, j, k});
      }
    }
  }
  std::set<Voxels> components;
  while (!left.empty()) {
    std::vector<Voxel> queue{*left.begin()};
    left.erase(left.begin());
    for (size_t next = 0; next < queue.size(); ++next) {
      for (int n = 0; n < 27; ++n) {
        const int x = n % 3 - 1, y = n / 3 % 3 - 1, z = n / 9 - 1;
        if (x != 0 && y != 0 && z != 0) continue;  // shares a corner only
        const Voxel beside{queue[next][0] + x, queue[next][1] + y, queue[next][2] + z};
        if (left.erase(beside) > 0) queue.push_back(beside);
      }
    }
    components.emplace(queue.begin(), queue.end());
  }
  return components;
}

TEST(VolumeComponents, are_those_of_a_flood_fill_of_single_voxels) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    const unsigned of_100 = 3 + 2 * seed;  // sparse specks to one large component
    const SparseVolume volume =
        make_volume(small_grid(19, 18, 21), [&](int, int, int) { return random() % 100 < of_100; });
    EXPECT_EQ(found_in(volume), expected_in(volume)) << seed;
  }
}

TEST(VolumeComponents, follow_a_line_that_winds_through_many_bricks) {
  const auto wire = [](int i, int j, int k) {
    return k % 4 == 0 ? (i == 0 || j % 2 == 0 || i == (j % 4 == 1 ? 39 : 0)) : i == 39 && j == 39;
  };
  const SparseVolume volume = make_volume(small_grid(40, 40, 20), wire);
  EXPECT_EQ(found_in(volume), expected_in(volume));
}

TEST(VolumeComponents, touch_at_corners_without_being_connected) {
  const SparseVolume corner = make_volume(small_grid(16, 16, 16), [](int i, int j, int k) {
    return (i == 7 && j == 7 && k == 7) || (i == 8 && j == 8 && k == 8);
  });
  EXPECT_EQ(found_in(corner).size(), 2U);
  const SparseVolume edge = make_volume(small_grid(16, 16, 16), [](int i, int j, int k) {
    return k == 7 && ((i == 7 && j == 7) || (i == 8 && j == 8));
  });
  EXPECT_EQ(found_in(edge).size(), 1U);
}

TEST(VolumeComponents, have_a_largest_one) {
  const SparseVolume volume = make_volume(small_grid(30, 10, 10), [](int i, int, int) {
    return i == 1 || (i >= 10 && i < 13) || i == 20;
  });
  VolumeComponents components;
  components.find(volume);
  ASSERT_EQ(components.count(), 3U);
  EXPECT_EQ(components.voxels(components.largest()), 300);
  components.find(SparseVolume(small_grid(8, 8, 8)));
  EXPECT_EQ(components.count(), 0U);
}

}  // namespace
}  // namespace v3d::recon
