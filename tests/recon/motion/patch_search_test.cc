#include <gtest/gtest.h>

#include "recon/motion/surface_patches.h"

namespace v3d::recon {
namespace {

constexpr int kReach = 5;

/// Raises the correlation of a patch at a shift to `value`, and less around it.
void add_peak(ShiftCorrelations& correlations, size_t patch, int across, int down, float value) {
  const int edge = correlations.edge();
  for (int y = 0; y < edge; ++y) {
    for (int x = 0; x < edge; ++x) {
      const int away = std::abs(x - kReach - across) + std::abs(y - kReach - down);
      float& at = correlations.of(patch)[static_cast<size_t>(y * edge + x)];
      at = std::max(at, value - 0.2F * static_cast<float>(away));
    }
  }
  correlations.set_known(patch);
}

/// Patches 0 to n - 1, each with its neighbours in the row.
std::vector<PatchNeighbours> row_of(uint32_t patches) {
  std::vector<PatchNeighbours> neighbours;
  for (uint32_t i = 0; i + 1 < patches; ++i) neighbours.push_back({i, i + 1});
  return neighbours;
}

TEST(LikelyShifts, are_the_best_correlations_of_patches_without_neighbours) {
  ShiftCorrelations correlations(2, kReach);
  add_peak(correlations, 0, 3, -2, 0.9F);
  add_peak(correlations, 1, -4, 1, 0.6F);
  const auto shifts = likely_shifts(correlations, {});
  ASSERT_TRUE(shifts[0] && shifts[1]);
  EXPECT_EQ(shifts[0]->across, 3);
  EXPECT_EQ(shifts[0]->down, -2);
  EXPECT_FLOAT_EQ(shifts[0]->correlation, 0.9F);
  EXPECT_EQ(shifts[1]->across, -4);
  EXPECT_EQ(shifts[1]->down, 1);
}

TEST(LikelyShifts, follow_the_neighbours_where_a_pattern_repeats) {
  // The pattern of the middle patches repeats every 4 steps; the wrong position correlates better.
  ShiftCorrelations correlations(5, kReach);
  for (const size_t clear : {size_t{0}, size_t{4}}) add_peak(correlations, clear, 2, 0, 0.9F);
  for (const size_t periodic : {size_t{1}, size_t{2}, size_t{3}}) {
    add_peak(correlations, periodic, 2, 0, 0.85F);
    add_peak(correlations, periodic, -2, 0, 0.90F);
  }
  for (const auto& shift : likely_shifts(correlations, row_of(5))) {
    ASSERT_TRUE(shift);
    EXPECT_EQ(shift->across, 2);
  }
}

TEST(LikelyShifts, keep_a_sharp_boundary_between_parts_that_move_apart) {
  ShiftCorrelations correlations(6, kReach);
  for (size_t i = 0; i < 6; ++i) add_peak(correlations, i, i < 3 ? -3 : 3, 0, 0.95F);
  const auto shifts = likely_shifts(correlations, row_of(6));
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(shifts[i]->across, i < 3 ? -3 : 3);
}

TEST(LikelyShifts, pass_through_unknown_patches_and_are_empty_there) {
  ShiftCorrelations correlations(3, kReach);
  add_peak(correlations, 0, 2, 2, 0.95F);
  add_peak(correlations, 2, 2, 2, 0.8F);
  add_peak(correlations, 2, -3, -3, 0.82F);
  const auto shifts = likely_shifts(correlations, row_of(3));
  EXPECT_FALSE(shifts[1]);
  ASSERT_TRUE(shifts[2]);
  EXPECT_EQ(shifts[2]->across, 2);
}

TEST(LikelyShifts, are_empty_at_the_border_of_the_search) {
  ShiftCorrelations correlations(1, kReach);
  add_peak(correlations, 0, kReach, 0, 0.9F);
  EXPECT_FALSE(likely_shifts(correlations, {})[0]);
}

}  // namespace
}  // namespace v3d::recon
