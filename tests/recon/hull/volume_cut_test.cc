#include <gtest/gtest.h>

#include <random>

#include "recon/hull/volume_components.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

/// One brick for each of the volume, with the voxels for which cut(i, j, k) is true.
template <class Cut>
std::vector<codec::Brick> bricks_of(const SparseVolume& volume, const Cut& cut) {
  std::vector<codec::Brick> bricks(volume.bricks().size(), codec::kEmptyBrick);
  for (size_t b = 0; b < bricks.size(); ++b) {
    const codec::BrickCoord at = volume.coords()[b];
    for (int n = 0; n < 512; ++n) {
      if (cut(8 * at.x + n % 8, 8 * at.y + n / 8 % 8, 8 * at.z + n / 64)) {
        bricks[b][n / 64] |= uint64_t{1} << (n % 64);
      }
    }
  }
  return bricks;
}

/// Reference for one pass of smooth(), one voxel at a time.
template <class Cut>
SparseVolume smoothed_once(const SparseVolume& volume, const Cut& cut) {
  return make_volume(volume.grid(), [&](int i, int j, int k) {
    if (!volume.get(i, j, k)) return false;
    int gone = 0, all = 0;
    for (int n = 0; n < 27; ++n) {
      const int x = i + n % 3 - 1, y = j + n / 3 % 3 - 1, z = k + n / 9 - 1;
      if (!volume.get(x, y, z)) continue;
      ++all;
      gone += cut(x, y, z);
    }
    return 2 * gone == all ? !cut(i, j, k) : 2 * gone < all;
  });
}

TEST(VolumeCut, smooths_by_the_majority_of_occupied_neighbours) {
  std::mt19937 random(4);
  const SparseVolume volume = make_volume(
      small_grid(21, 19, 18), [&](int i, int, int) { return i < 9 || random() % 3 != 0; });
  std::vector<uint8_t> chosen(24 * 24 * 24);
  for (uint8_t& c : chosen) c = random() % 5 < 2;
  const auto cut = [&](int i, int j, int k) { return chosen[(k * 24 + j) * 24 + i] != 0; };
  VolumeCut ours(volume, bricks_of(volume, cut));
  ours.smooth(1);
  EXPECT_EQ(ours.remaining(), smoothed_once(volume, cut));
}

TEST(VolumeCut, smoothing_keeps_slender_parts_and_removes_specks_of_the_cut) {
  const auto blade = [](int i, int j, int k) { return i == 9 && j >= 8 && j < 11 && k < 30; };
  const SparseVolume volume = make_volume(small_grid(20, 20, 32), blade);
  VolumeCut none(volume, bricks_of(volume, [](int, int, int) { return false; }));
  none.smooth(8);
  EXPECT_EQ(none.remaining(), volume);
  VolumeCut speck(volume, bricks_of(volume, [](int, int j, int k) { return j == 9 && k == 15; }));
  speck.smooth(1);
  EXPECT_EQ(speck.remaining(), volume);
}

/// A block of 12 voxels with a piece of 3 x 3 x 3 on a stalk.
SparseVolume block_with_bud() {
  return make_volume(small_grid(30, 16, 16), [](int i, int j, int k) {
    if (i < 12) return j < 12 && k < 12;
    if (i < 16) return j == 5 && k == 5;
    return i < 19 && j >= 4 && j < 7 && k >= 4 && k < 7;
  });
}

TEST(VolumeCut, removes_small_severed_pieces_but_no_large_or_earlier_ones) {
  const SparseVolume volume = block_with_bud();
  const auto stalk = [](int i, int, int) { return i >= 12 && i < 16; };
  VolumeCut small(volume, bricks_of(volume, stalk));
  small.add_fragments(28);
  EXPECT_EQ(small.remaining().count(), 12 * 12 * 12);
  VolumeCut large(volume, bricks_of(volume, stalk));
  large.add_fragments(27);
  EXPECT_EQ(large.remaining().count(), 12 * 12 * 12 + 27);
  VolumeCut elsewhere(volume, bricks_of(volume, [](int i, int, int) { return i < 2; }));
  elsewhere.add_fragments(1'000);
  EXPECT_EQ(elsewhere.remaining().count(), volume.count() - 2 * 12 * 12);
}

TEST(VolumeCut, counts_the_voxels_of_pieces_of_whole_bricks) {
  // Five bricks in a row, of which the cut takes a quarter of the second.
  const SparseVolume volume = make_volume(small_grid(40, 8, 8), [](int, int, int) { return true; });
  const auto slit = bricks_of(volume, [](int i, int, int) { return i == 8 || i == 9; });
  constexpr int kOne = 512, kOther = 3 * 512 + 6 * 64;
  for (const int crumb : {1, kOne, kOne + 1, 3 * 512, 3 * 512 + 1, kOther, kOther + 1, 2560}) {
    VolumeCut cut(volume, slit);
    cut.add_fragments(crumb);
    const int left = (kOne >= crumb ? kOne : 0) + (kOther >= crumb ? kOther : 0);
    EXPECT_EQ(cut.remaining().count(), left) << "with crumbs below " << crumb;
  }
}

TEST(VolumeCut, keeps_a_piece_that_was_separate_before) {
  const SparseVolume volume = make_volume(small_grid(30, 16, 16), [](int i, int j, int k) {
    return (i < 12 && j < 12 && k < 12) || (i >= 20 && i < 22 && j < 2 && k < 2);
  });
  VolumeCut cut(volume, bricks_of(volume, [](int i, int, int) { return i == 11; }));
  cut.add_fragments(100);
  EXPECT_EQ(cut.remaining().count(), volume.count() - 12 * 12);
}

TEST(VolumeCut, joins_voxels_by_edges_but_not_by_corners) {
  for (const int z : {8, 9}) {
    // A voxel on a stalk of one, and another way from it to the block: (10, 9, z).
    const SparseVolume volume = make_volume(small_grid(24, 16, 16), [z](int i, int j, int k) {
      return i < 10 || (i < 12 && j == 8 && k == 8) || (i == 10 && j == 9 && k == z);
    });
    VolumeCut cut(
        volume, bricks_of(volume, [](int i, int j, int k) { return i == 10 && j == 8 && k == 8; }));
    cut.add_fragments(50);
    const SparseVolume left = cut.remaining();
    EXPECT_TRUE(left.get(10, 9, z));
    EXPECT_EQ(left.get(11, 8, 8), z == 8) << "it touches by an edge, else by a corner";
  }
}

TEST(VolumeCut, lists_bricks_near_voxels_beyond_a_smaller_cut) {
  const SparseVolume volume = make_volume(small_grid(80, 8, 8), [](int, int, int) { return true; });
  const auto less = [](int i, int, int) { return i < 4 || i == 60; };
  const VolumeCut cut(volume, bricks_of(volume, [&](int i, int j, int k) {
                        return (less(i, j, k) && i != 60) || (i == 33 && j == 2 && k == 5);
                      }));
  const std::vector<uint8_t> near = cut.bricks_near_more_than(bricks_of(volume, less));
  for (size_t b = 0; b < near.size(); ++b) {
    const int x = volume.coords()[b].x;
    EXPECT_EQ(near[b] != 0, x >= 3 && x <= 5) << "brick " << x;
  }
}

TEST(VolumeCut, keeps_the_requested_voxels) {
  const SparseVolume volume = block_with_bud();
  const auto stalk = [](int i, int, int) { return i >= 12 && i < 16; };
  VolumeCut cut(volume, bricks_of(volume, stalk));
  cut.keep(bricks_of(volume, [](int i, int, int) { return i < 14; }));
  EXPECT_EQ(cut.remaining().count(), volume.count() - 2);
}

TEST(VolumeCut, of_everything_is_empty) {
  const SparseVolume volume = block_with_bud();
  VolumeCut cut(volume, bricks_of(volume, [](int, int, int) { return true; }));
  cut.smooth(2);
  cut.add_fragments(10);
  EXPECT_EQ(cut.remaining(), SparseVolume(volume.grid()));
}

}  // namespace
}  // namespace v3d::recon
