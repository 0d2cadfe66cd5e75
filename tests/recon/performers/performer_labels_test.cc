#include "recon/performers/performer_labels.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <random>
#include <vector>

#include "recon/volumes.h"

namespace v3d::recon {
namespace {

/// Two performers with a part of the voxels each, and voxels of nobody.
struct Labelled {
  SparseVolume volume;
  std::vector<PerformerVoxels> performers{{3, {}}, {7, {}}};

  explicit Labelled(unsigned seed) {
    std::mt19937_64 random(seed);
    volume = make_volume(small_grid(37, 30, 33), [&](int i, int j, int k) {
      return (i < 12 || i > 20) && random() % 8 != 0 && j + k > 4;
    });
    for (size_t b = 0; b < volume.bricks().size(); ++b) {
      codec::Brick first{}, second{};
      const int x = volume.coords()[b].x;
      for (int z = 0; z < 8; ++z) {
        const uint64_t bits = volume.bricks()[b][z];
        const uint64_t some = random() & random();
        first[z] = x == 0 ? bits : x == 1 ? bits & some : 0;
        second[z] = x > 2 ? bits & ~some : 0;
      }
      performers[0].voxels.push_back(first);
      performers[1].voxels.push_back(second);
    }
  }

  /// The label of a voxel; -1 where it is not occupied.
  int at(int i, int j, int k) const {
    if (!volume.get(i, j, k)) return -1;
    const int brick = volume.index_of({i / 8, j / 8, k / 8});
    for (const PerformerVoxels& p : performers) {
      if ((p.voxels[brick][k % 8] >> (8 * (j % 8) + i % 8) & 1) != 0) return p.identity;
    }
    return 0;
  }
};

TEST(VertexLabels, are_those_of_the_occupied_voxels_beside_the_vertices) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const Labelled scene(seed);
    const std::vector<uint8_t> labels = VertexLabels().find(scene.volume, scene.performers);
    const Mesh mesh = marching_cubes(scene.volume);
    ASSERT_EQ(labels.size(), mesh.vertices.size());
    for (size_t v = 0; v < labels.size(); ++v) {
      // In half voxels; the centre of voxel i is 2 i + 1.
      const VoxelGrid& grid = scene.volume.grid();
      const Eigen::Vector3i half =
          (2 * (mesh.vertices[v].cast<double>() - grid.origin) / grid.voxel_m)
              .array()
              .round()
              .matrix()
              .cast<int>();
      int expected = -1;
      for (int side = 0; side < 2; ++side) {
        Eigen::Vector3i voxel;
        for (int a = 0; a < 3; ++a) {
          voxel[a] = half[a] % 2 == 0 ? half[a] / 2 - side : (half[a] - 1) / 2;
        }
        expected = std::max(expected, scene.at(voxel.x(), voxel.y(), voxel.z()));
      }
      ASSERT_EQ(labels[v], expected) << "vertex " << v << " of seed " << seed;
    }
  }
}

TEST(VertexLabels, do_not_depend_on_the_number_of_threads) {
  const Labelled scene(9);
  const tbb::global_control more_threads_than_cores(tbb::global_control::max_allowed_parallelism,
                                                    4);
  const auto with_threads = [&](int threads) {
    tbb::task_arena arena(threads);
    return arena.execute([&] { return VertexLabels().find(scene.volume, scene.performers); });
  };
  EXPECT_EQ(with_threads(1), with_threads(4));
}

}  // namespace
}  // namespace v3d::recon
