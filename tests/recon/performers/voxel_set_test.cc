#include "recon/performers/voxel_set.h"

#include <gtest/gtest.h>

namespace v3d::recon {
namespace {

constexpr codec::Brick kRow{0b1111};          // four voxels of the lowest layer
constexpr codec::Brick kPair{0b110, 0b1};     // two of these, and one of the layer above
constexpr codec::Brick kOther{0, 0, 0b1010};  // two voxels apart from both

TEST(VoxelSet, counts_the_voxels_of_all_layers) {
  EXPECT_EQ(voxel_count(codec::kEmptyBrick), 0);
  EXPECT_EQ(voxel_count(kRow), 4);
  EXPECT_EQ(voxel_count(kPair), 3);
  EXPECT_TRUE(is_empty(codec::kEmptyBrick));
  EXPECT_FALSE(is_empty(kOther));
}

TEST(VoxelSet, has_the_common_voxels_of_two_bricks) {
  EXPECT_EQ(common(kRow, kPair), (codec::Brick{0b110}));
  EXPECT_TRUE(is_empty(common(kRow, kOther)));
}

TEST(VoxelSet, adds_and_subtracts_voxels_once) {
  codec::Brick sum = kRow;
  add(sum, kPair);
  EXPECT_EQ(voxel_count(sum), 5);
  subtract(sum, kPair);
  EXPECT_EQ(sum, (codec::Brick{0b1001}));
  subtract(sum, kPair);
  EXPECT_EQ(voxel_count(sum), 2);
}

}  // namespace
}  // namespace v3d::recon
