#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <numbers>
#include <set>

#include "codec/cube_cases.h"
#include "recon/hull/sparse_volume.h"
#include "tests/recon/random_rig.h"
#include "tests/recon/volumes.h"

namespace v3d::recon {
namespace {

/// Pseudo-random voxels, from sparse to nearly solid.
SparseVolume random_volume(const VoxelGrid& grid, uint32_t seed, uint32_t per_thousand) {
  return make_volume(grid, [&](int i, int j, int k) {
    uint32_t h = seed ^ (static_cast<uint32_t>(i) * 73856093U) ^
                 (static_cast<uint32_t>(j) * 19349663U) ^ (static_cast<uint32_t>(k) * 83492791U);
    h = (h ^ h >> 15) * 0x2C1B3C6DU;
    h = (h ^ h >> 12) * 0x297A2D39U;
    return (h ^ h >> 15) % 1000 < per_thousand;
  });
}

/// Voxels whose centre lies within `radius` voxels of the middle of the grid.
SparseVolume ball(int edge, double radius) {
  return make_volume(small_grid(edge, edge, edge), [&](int i, int j, int k) {
    const double c = 0.5 * (edge - 1);
    return std::hypot(i - c, j - c, k - c) <= radius;
  });
}

double area(const Mesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f a = mesh.vertices[t[1]] - mesh.vertices[t[0]];
    const Eigen::Vector3f b = mesh.vertices[t[2]] - mesh.vertices[t[0]];
    sum += 0.5 * a.cross(b).norm();
  }
  return sum;
}

/// Positions of the vertices in half voxels from the grid's origin.
std::vector<std::array<int, 3>> half_voxels(const Mesh& mesh, const VoxelGrid& grid) {
  std::vector<std::array<int, 3>> positions;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    const Eigen::Vector3d h = (vertex.cast<double>() - grid.origin) * (2 / grid.voxel_m);
    positions.push_back({static_cast<int>(std::lround(h.x())), static_cast<int>(std::lround(h.y())),
                         static_cast<int>(std::lround(h.z()))});
  }
  return positions;
}

bool same(const Mesh& a, const Mesh& b) {
  return a.vertices == b.vertices && a.triangles == b.triangles;
}

TEST(CubeCases, use_exactly_the_edges_between_occupied_and_empty_corners) {
  for (int occupied = 0; occupied < 256; ++occupied) {
    std::set<int> used;
    const codec::CubeCase& shape = codec::cube_cases()[occupied];
    for (int t = 0; t < shape.count; ++t) {
      used.insert(shape.triangles[t].begin(), shape.triangles[t].end());
    }
    for (int number = 0; number < 12; ++number) {
      const codec::CubeEdge e = codec::cube_edge(number);
      const int low = e.x | e.y << 1 | e.z << 2;
      const bool crossed = ((occupied >> low ^ occupied >> (low | 1 << e.axis)) & 1) != 0;
      EXPECT_EQ(used.contains(number), crossed) << "case " << occupied << " edge " << number;
    }
  }
}

TEST(CubeCases, draw_no_line_inside_a_face_that_the_neighbour_could_draw_too) {
  // Two cubes side by side along each axis, all 2^12 occupancies, inside an empty border.
  for (int axis = 0; axis < 3; ++axis) {
    std::array<int, 3> size{2, 2, 2};
    size[axis] = 3;
    for (uint32_t bits = 0; bits < 1U << 12; ++bits) {
      const auto occupied = [&](int i, int j, int k) {
        return (bits >> (i + size[0] * (j + size[1] * k)) & 1) != 0;
      };
      const VoxelGrid grid = small_grid(size[0], size[1], size[2]);
      ASSERT_TRUE(is_manifold(marching_cubes(make_volume(grid, occupied)))) << bits;
    }
  }
}

TEST(MarchingCubes, turns_an_empty_volume_into_an_empty_mesh) {
  const Mesh m = marching_cubes(SparseVolume(small_grid(5, 5, 5)));
  EXPECT_TRUE(m.vertices.empty());
  EXPECT_TRUE(m.triangles.empty());
}

TEST(MarchingCubes, turns_one_voxel_into_an_octahedron) {
  const SparseVolume volume = make_volume(
      small_grid(3, 3, 3), [](int i, int j, int k) { return i == 1 && j == 2 && k == 0; });
  const Mesh m = marching_cubes(volume);
  EXPECT_EQ(m.vertices.size(), 6U);
  EXPECT_EQ(m.triangles.size(), 8U);
  EXPECT_NEAR(enclosed_volume(m), 1e-6 / 6, 1e-10);
  EXPECT_TRUE(is_manifold(m));
}

TEST(MarchingCubes, joins_voxels_that_touch_along_an_edge) {
  const SparseVolume volume =
      make_volume(small_grid(2, 2, 2), [](int i, int j, int k) { return k == 0 && i == j; });
  const Mesh m = marching_cubes(volume);
  EXPECT_TRUE(is_manifold(m));
  EXPECT_EQ(connected_components(m), 1);
}

TEST(MarchingCubes, keeps_voxels_apart_that_touch_at_a_corner) {
  const SparseVolume volume =
      make_volume(small_grid(2, 2, 2), [](int i, int j, int k) { return i == j && j == k; });
  const Mesh m = marching_cubes(volume);
  EXPECT_TRUE(is_manifold(m));
  EXPECT_EQ(connected_components(m), 2);
}

TEST(MarchingCubes, places_vertices_on_the_half_voxel_lattice_to_the_bit) {
  const SparseVolume volume = ball(21, 9);
  const Mesh m = marching_cubes(volume);
  const VoxelGrid& grid = volume.grid();
  const auto positions = half_voxels(m, grid);
  for (size_t n = 0; n < positions.size(); ++n) {
    const auto& h = positions[n];
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_EQ(m.vertices[n][axis],
                static_cast<float>(grid.origin[axis] + h[axis] * grid.voxel_m / 2));
    }
    // Odd along two axes, even along the crossed edge.
    ASSERT_EQ(h[0] % 2 + h[1] % 2 + h[2] % 2, 2);
  }
}

TEST(MarchingCubes, encloses_the_volume_of_a_ball) {
  const Mesh m = marching_cubes(ball(67, 30));
  const double ball_m3 = 4.0 / 3 * std::numbers::pi * std::pow(0.3, 3);
  EXPECT_NEAR(enclosed_volume(m), ball_m3, 0.02 * ball_m3);
  // Discrete normals make the surface rougher than the ball's, by less than a tenth.
  const double ball_m2 = 4 * std::numbers::pi * 0.3 * 0.3;
  EXPECT_GT(area(m), ball_m2);
  EXPECT_LT(area(m), 1.12 * ball_m2);
  EXPECT_EQ(connected_components(m), 1);
}

TEST(MarchingCubes, closes_the_surface_at_the_border_of_the_grid) {
  for (const int edge : {1, 7, 8, 9, 16, 17}) {
    const SparseVolume volume =
        make_volume(small_grid(edge, edge + 1, edge), [](int, int, int) { return true; });
    const Mesh m = marching_cubes(volume);
    EXPECT_TRUE(is_manifold(m)) << edge;
    EXPECT_EQ(connected_components(m), 1);
    EXPECT_EQ(m.vertices.size(), 2U * (2 * edge * (edge + 1) + edge * edge));
  }
}

RC_GTEST_PROP(MarchingCubes, closes_every_random_volume_into_a_manifold, ()) {
  const auto edge = [] { return uniform_int(1, 22); };
  const VoxelGrid grid = small_grid(edge(), edge(), edge());
  const SparseVolume volume =
      random_volume(grid, *rc::gen::arbitrary<uint32_t>(), uniform_int(1, 1000));
  const Mesh m = marching_cubes(volume);
  RC_ASSERT(is_manifold(m));
  // Every crossing of the lattice is a vertex, once.
  const auto positions = half_voxels(m, grid);
  const std::set<std::array<int, 3>> distinct(positions.begin(), positions.end());
  RC_ASSERT(distinct.size() == positions.size());
}

RC_GTEST_PROP(MarchingCubes, separates_occupied_from_empty_voxels_along_every_lattice_edge, ()) {
  const VoxelGrid grid = small_grid(uniform_int(1, 18), uniform_int(1, 18), 9);
  const SparseVolume volume =
      random_volume(grid, *rc::gen::arbitrary<uint32_t>(), uniform_int(1, 1000));
  const Mesh m = marching_cubes(volume);
  const auto positions = half_voxels(m, grid);
  const std::set<std::array<int, 3>> found(positions.begin(), positions.end());
  std::set<std::array<int, 3>> expected;
  for (int axis = 0; axis < 3; ++axis) {
    for (int k = -1; k < grid.counts[2]; ++k) {
      for (int j = -1; j < grid.counts[1]; ++j) {
        for (int i = -1; i < grid.counts[0]; ++i) {
          std::array<int, 3> next{i, j, k};
          ++next[axis];
          if (volume.get(i, j, k) == volume.get(next[0], next[1], next[2])) continue;
          std::array<int, 3> half{2 * i + 1, 2 * j + 1, 2 * k + 1};
          ++half[axis];
          expected.insert(half);
        }
      }
    }
  }
  RC_ASSERT(found == expected);
}

TEST(MarchingCubes, returns_the_same_bytes_after_any_previous_volume) {
  MarchingCubes used;
  Mesh mesh;
  used.run(random_volume(small_grid(70, 50, 60), 3, 500), mesh);
  mesh.colours.resize(mesh.vertices.size());
  for (const SparseVolume& volume : {ball(21, 9), SparseVolume(small_grid(5, 5, 5)),
                                     random_volume(small_grid(30, 9, 70), 4, 2)}) {
    used.run(volume, mesh);
    EXPECT_TRUE(same(mesh, marching_cubes(volume)));
    EXPECT_TRUE(mesh.colours.empty());
  }
}

TEST(MarchingCubes, finds_the_surface_in_rows_of_more_than_64_bricks) {
  for (const int length : {63 * 8, 64 * 8, 64 * 8 + 1, 65 * 8, 129 * 8}) {
    const SparseVolume beam =
        make_volume(small_grid(length, 17, 16), [](int, int, int) { return true; });
    const Mesh m = marching_cubes(beam);
    EXPECT_TRUE(is_manifold(m)) << length;
    EXPECT_EQ(static_cast<int64_t>(m.vertices.size()),
              2 * (int64_t{length} * 17 + int64_t{length} * 16 + 17 * 16));
  }
}

TEST(MarchingCubes, returns_the_same_bytes_for_any_number_of_threads) {
  const SparseVolume volume = random_volume(small_grid(70, 50, 60), 7, 300);
  const tbb::global_control more_threads_than_cores(tbb::global_control::max_allowed_parallelism,
                                                    3);
  const Mesh one = tbb::task_arena(1).execute([&] { return marching_cubes(volume); });
  for (const int threads : {2, 3}) {
    tbb::task_arena arena(threads);
    EXPECT_TRUE(same(one, arena.execute([&] { return marching_cubes(volume); })));
  }
}

}  // namespace
}  // namespace v3d::recon
