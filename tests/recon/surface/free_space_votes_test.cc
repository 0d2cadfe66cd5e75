#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "recon/surface/concavity_carving.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

SparseVolume full(int nx, int ny, int nz) {
  return make_volume(small_grid(nx, ny, nz), [](int, int, int) { return true; });
}

Eigen::Vector3f middle_of(const SparseVolume& volume, int i, int j, int k) {
  return volume.grid().center(i, j, k).cast<float>();
}

bool get(const SparseVolume& volume, const std::vector<codec::Brick>& bricks, int i, int j, int k) {
  const int brick = volume.index_of({i / 8, j / 8, k / 8});
  return (bricks[brick][k % 8] >> (8 * (j % 8) + i % 8) & 1) != 0;
}

int count(const std::vector<codec::Brick>& bricks) {
  int sum = 0;
  for (const codec::Brick& brick : bricks) {
    for (const uint64_t layer : brick) sum += codec::bit_count(layer);
  }
  return sum;
}

TEST(FreeSpaceVotes, count_for_a_voxel_and_the_26_around_it_across_the_borders_of_bricks) {
  const SparseVolume volume = full(24, 24, 24);
  for (const int at : {3, 7, 8, 15, 16}) {
    FreeSpaceVotes votes(volume);
    votes.vote_free(middle_of(volume, at, at, 9));
    const std::vector<codec::Brick> seen = votes.free_voxels(1);
    EXPECT_EQ(count(seen), 27);
    for (const int way : {-1, 0, 1}) EXPECT_TRUE(get(volume, seen, at + way, at - way, 9 + way));
    EXPECT_EQ(count(votes.free_voxels(2)), 0);
  }
}

TEST(FreeSpaceVotes, must_outnumber_the_votes_for_a_seen_surface) {
  const SparseVolume volume = full(16, 16, 16);
  FreeSpaceVotes votes(volume);
  for (int i = 0; i < 4; ++i) votes.vote_free(middle_of(volume, 5, 5, 5));
  for (int i = 0; i < 3; ++i) votes.vote_occupied(middle_of(volume, 7, 5, 5));
  EXPECT_EQ(count(votes.free_voxels(4)), 27);
  votes.vote_occupied(middle_of(volume, 7, 5, 5));
  EXPECT_EQ(count(votes.free_voxels(4)), 18) << "the 9 between them are even";
}

TEST(FreeSpaceVotes, may_be_several_at_once) {
  const SparseVolume volume = full(16, 16, 16);
  FreeSpaceVotes votes(volume);
  votes.vote_free(middle_of(volume, 5, 5, 5), 6);
  for (int i = 0; i < 5; ++i) votes.vote_occupied(middle_of(volume, 5, 5, 5));
  EXPECT_EQ(count(votes.free_voxels(6)), 27);
  EXPECT_EQ(count(votes.free_voxels(7)), 0);
  votes.vote_occupied(middle_of(volume, 5, 5, 5), 2);
  EXPECT_EQ(count(votes.free_voxels(6)), 0);
}

TEST(FreeSpaceVotes, are_dropped_outside_the_volume) {
  const SparseVolume volume =
      make_volume(small_grid(20, 16, 16), [](int i, int j, int) { return i == 9 && j < 8; });
  FreeSpaceVotes votes(volume);
  votes.vote_free(middle_of(volume, 9, 3, 3));
  EXPECT_EQ(count(votes.free_voxels(1)), 9) << "the voxels around that are occupied";
  for (const float far : {-1e30F, -1.0F, 5.0F, 1e30F, std::nanf("")}) {
    votes.vote_free({far, far, far});
    votes.vote_free({0, 0.25F, far});
  }
  votes.vote_free(middle_of(volume, 17, 3, 3));
  EXPECT_EQ(count(votes.free_voxels(1)), 9);
}

TEST(FreeSpaceVotes, may_come_from_many_threads) {
  const SparseVolume volume = full(8, 8, 8);
  FreeSpaceVotes votes(volume);
  constexpr int kVotes = 10'000;
  tbb::parallel_for(0, kVotes, [&](int) { votes.vote_free(middle_of(volume, 4, 4, 4)); });
  EXPECT_EQ(count(votes.free_voxels(kVotes)), 27);
  EXPECT_EQ(count(votes.free_voxels(kVotes + 1)), 0);
}

TEST(FreeSpaceVotes, of_one_kind_never_overflow_into_the_other) {
  const SparseVolume volume = full(8, 8, 8);
  const Eigen::Vector3f middle = middle_of(volume, 4, 4, 4);
  FreeSpaceVotes free(volume), occupied(volume);
  constexpr int kAll = 2 * 65'536 / 255;
  tbb::parallel_for(0, kAll, [&](int) {
    free.vote_free(middle, 255);
    occupied.vote_occupied(middle, 255);
  });
  EXPECT_EQ(count(free.free_voxels(FreeSpaceVotes::kMaxVotes)), 27);
  EXPECT_EQ(count(free.free_voxels(FreeSpaceVotes::kMaxVotes + 1)), 0);
  occupied.vote_free(middle);
  EXPECT_EQ(count(occupied.free_voxels(1)), 0);
}

}  // namespace
}  // namespace v3d::recon
