#include "recon/pipeline/frame_volume.h"

#include <gtest/gtest.h>

#include "recon/pipeline/compact_frame.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

/// A ball of 5 voxels radius, of which no voxel lies in the first bricks.
SparseVolume distant_ball() {
  return make_volume(small_grid(60, 50, 40), [](int i, int j, int k) {
    return (i - 40) * (i - 40) + (j - 30) * (j - 30) + (k - 20) * (k - 20) <= 25;
  });
}

/// The frame of a volume; `move`: how far its vertices are moved, metres.
std::vector<uint8_t> frame_of(const SparseVolume& volume, float move = 0) {
  const VoxelGrid& grid = volume.grid();
  const codec::BrickVolume bricks = volume.view();
  Mesh mesh = marching_cubes(volume);
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex.x() += move;
  const auto positions = vertex_positions(mesh.vertices);
  codec::FrameContent content;
  content.metadata.origin = {grid.origin.x(), grid.origin.y(), grid.origin.z()};
  content.metadata.step = grid.voxel_m / 2;
  content.volume = &bricks;
  if (move > 0) content.positions = positions;
  return codec::FrameEncoder({.displacement_step_m = grid.voxel_m / 20}).encode(content).value();
}

VoxelGrid grid_with(const VoxelGrid& grid, int64_t count) {
  return {grid.origin, grid.voxel_m, {count, count, count}};
}

TEST(FrameVolume, has_the_voxels_from_which_the_frame_was_encoded) {
  const SparseVolume volume = distant_ball();
  for (const float move : {0.0F, 0.001F}) {
    const auto frame = frame_of(volume, move);
    const auto grid = frame_grid(frame).value();
    EXPECT_EQ(grid.origin, volume.grid().origin);
    EXPECT_NEAR(grid.voxel_m, volume.grid().voxel_m, 1e-12) << "also with a finer lattice";
    EXPECT_EQ(grid.counts, (std::array<int64_t, 3>{48, 40, 32}));
    const auto found = frame_volume(frame, grid_with(volume.grid(), 60)).value();
    EXPECT_TRUE(std::ranges::equal(found.bricks(), volume.bricks()));
    EXPECT_TRUE(std::ranges::equal(found.coords(), volume.coords()));
  }
}

TEST(FrameVolume, has_a_grid_of_one_brick_for_a_frame_without_voxels) {
  const auto frame = frame_of(SparseVolume(small_grid(60, 50, 40)));
  const auto grid = frame_grid(frame).value();
  EXPECT_EQ(grid.counts, (std::array<int64_t, 3>{8, 8, 8}));
  EXPECT_TRUE(frame_volume(frame, grid).value().bricks().empty());
}

TEST(FrameVolume, is_empty_for_a_frame_without_a_volume_and_for_other_bytes) {
  const std::vector<codec::VertexPosition> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<codec::VertexTriangle> triangles{{0, 1, 2}};
  codec::FrameContent content;
  content.metadata.step = 0.5;
  content.positions = positions;
  content.triangles = triangles;
  const auto explicit_frame = codec::FrameEncoder({}).encode(content).value();
  auto damaged = frame_of(distant_ball());
  damaged.back() ^= 1;
  for (const auto& frame : {explicit_frame, damaged, std::vector<uint8_t>()}) {
    EXPECT_FALSE(frame_grid(frame));
    EXPECT_FALSE(frame_volume(frame, grid_with(distant_ball().grid(), 60)));
  }
}

}  // namespace
}  // namespace v3d::recon
