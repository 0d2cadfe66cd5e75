#include "codec/connectivity_code.h"

#include <gtest/gtest.h>

#include <numeric>

#include "codec/vertex_hierarchy.h"
#include "tests/codec/motion_scene.h"

namespace v3d::codec {
namespace {

TEST(ConnectivityCode, decodes_the_triangles_that_it_reports) {
  for (uint32_t seed = 0; seed < 50; ++seed) {
    const auto given = random_segment(seed, 1, 2 + seed, 3 * seed);
    const auto coded = encode_connectivity(given.triangles, 2 + seed);
    EXPECT_EQ(decode_connectivity(coded.bytes, 3 * seed, 2 + seed), coded.triangles);
    EXPECT_EQ(coded.order.size(), 2 + seed);
  }
}

TEST(ConnectivityCode, takes_less_than_a_bit_for_a_triangle_of_a_regular_mesh) {
  const auto given = moving_tube(1, 100, 50);
  const auto coded = encode_connectivity(given.triangles, 5000);
  EXPECT_LT(8 * coded.bytes.size(), given.triangles.size() / 2);
}

TEST(ConnectivityCode, rejects_bytes_for_another_number_of_triangles_or_vertices) {
  const auto given = moving_tube(1);
  const auto coded = encode_connectivity(given.triangles, 240);
  const auto triangles = static_cast<uint32_t>(given.triangles.size());
  EXPECT_TRUE(decode_connectivity(coded.bytes, triangles, 241)) << "a vertex without triangles";
  EXPECT_FALSE(decode_connectivity(coded.bytes, triangles, 239));
  EXPECT_FALSE(decode_connectivity(coded.bytes, triangles - 1, 240));
  EXPECT_FALSE(decode_connectivity(coded.bytes, triangles + 100, 240));
  EXPECT_FALSE(decode_connectivity({}, 1 << 20, 1 << 19));
}

TEST(VertexHierarchy, has_the_coarse_neighbours_of_a_vertex_before_it) {
  const auto given = moving_tube(1);
  const VertexHierarchy hierarchy(given.triangles, 240);
  std::vector<bool> before(240);
  for (const uint32_t v : hierarchy.order()) {
    EXPECT_EQ(hierarchy.neighbours(v).empty(), v == hierarchy.order()[0]);
    for (const uint32_t other : hierarchy.neighbours(v)) {
      EXPECT_TRUE(before[other]);
      EXPECT_GE(hierarchy.level(other), hierarchy.level(v));
    }
    before[v] = true;
  }
  EXPECT_EQ(std::accumulate(before.begin(), before.end(), 0), 240);
}

TEST(VertexHierarchy, fits_weights_whose_mean_moves_as_the_vertex_in_an_affine_motion) {
  const auto given = moving_tube(1);
  VertexHierarchy hierarchy(given.triangles, 240);
  std::vector<LatticePosition> rest, moved;
  for (const VertexPosition& p : given.positions[0]) {
    const LatticePosition q{static_cast<int32_t>(1e5F * p[0]), static_cast<int32_t>(1e5F * p[1]),
                            static_cast<int32_t>(1e5F * p[2])};
    rest.push_back(q);
    moved.push_back({q[1] + 7, -q[0], q[2] + q[0] / 2});
  }
  // Sum of the differences between the motion of a vertex and of the mean.
  const auto misfit = [&] {
    double sum = 0;
    for (uint32_t v = 0; v < 240; ++v) {
      const auto neighbours = hierarchy.neighbours(v);
      const auto weights = hierarchy.weights(v);
      if (neighbours.size() < 4) continue;
      EXPECT_EQ(std::accumulate(weights.begin(), weights.end(), 0), VertexHierarchy::kOne);
      double of_vertex = moved[v][0] - rest[v][0];
      for (size_t n = 0; n < neighbours.size(); ++n) {
        of_vertex -= weights[n] / 4096.0 * (moved[neighbours[n]][0] - rest[neighbours[n]][0]);
      }
      sum += std::abs(of_vertex);
    }
    return sum;
  };
  const double before = misfit();
  hierarchy.fit_weights(rest);
  EXPECT_LT(misfit(), before / 2);
}

}  // namespace
}  // namespace v3d::codec
