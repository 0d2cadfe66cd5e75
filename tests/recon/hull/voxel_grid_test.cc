#include "recon/hull/voxel_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "base/core/error.h"
#include "base/geometry/rigid_transform.h"
#include "support/message_of.h"

namespace v3d::recon {
namespace {

using ::testing::HasSubstr;

const Box kStudio{{-1.5, -1.5, 0}, {1.5, 1.5, 2}};
constexpr double k23GB = 23.1e9;

std::string refusal(const VoxelGrid& grid, double bytes_available) {
  return test::message_of<InputError>([&] { require_memory(grid, bytes_available); });
}

TEST(VoxelGrid, covers_the_box_without_a_spare_layer_of_voxels) {
  const VoxelGrid grid = VoxelGrid::covering(kStudio, 0.008);
  EXPECT_EQ(grid.counts, (std::array<int64_t, 3>{375, 375, 250}));
  EXPECT_EQ(VoxelGrid::covering(kStudio, 0.007).counts, (std::array<int64_t, 3>{429, 429, 286}));
}

TEST(VoxelGrid, puts_the_centre_of_a_voxel_half_a_voxel_inside) {
  const VoxelGrid grid = VoxelGrid::covering(kStudio, 0.01);
  EXPECT_TRUE(grid.center(0, 0, 0).isApprox(Eigen::Vector3d(-1.495, -1.495, 0.005)));
  EXPECT_TRUE(grid.center(299, 0, 199).isApprox(Eigen::Vector3d(1.495, -1.495, 1.995)));
}

TEST(VoxelGrid, rejects_boxes_and_voxels_without_size) {
  EXPECT_THROW(VoxelGrid::covering(kStudio, 0), InputError);
  EXPECT_THROW(VoxelGrid::covering(kStudio, -0.01), InputError);
  EXPECT_THROW(VoxelGrid::covering(kStudio, 1e-300), InputError);
  EXPECT_THROW(VoxelGrid::covering(kStudio, std::numeric_limits<double>::quiet_NaN()), InputError);
  EXPECT_THROW(VoxelGrid::covering({{0, 0, 0}, {1, 0, 1}}, 0.01), InputError);
  EXPECT_THROW(VoxelGrid::covering({{0, 0, 2}, {1, 1, 1}}, 0.01), InputError);
}

TEST(VoxelGrid, rejects_more_memory_than_available_and_reports_the_calculation) {
  const std::string message = refusal(VoxelGrid::covering(kStudio, 0.0001), k23GB);
  EXPECT_EQ(message,
            "0.1 mm in 3 x 3 x 2 m is 30,000 x 30,000 x 20,000 voxels, up to 2.25 TB at 1 bit a "
            "voxel; 23.1 GB are available; try 1 mm voxels");
}

TEST(VoxelGrid, accepts_what_fits_in_memory) {
  EXPECT_NO_THROW(require_memory(VoxelGrid::covering(kStudio, 0.001), k23GB));
  EXPECT_NO_THROW(require_memory(VoxelGrid::covering(kStudio, 0.008), 1e8));
}

TEST(VoxelGrid, rejects_extreme_voxels_without_overflow) {
  EXPECT_THAT(refusal(VoxelGrid::covering(kStudio, 1e-9), k23GB),
              HasSubstr("3,000,000,000 x 3,000,000,000 x 2,000,000,000 voxels"));
  const Box planet{{-6e6, -6e6, -6e6}, {6e6, 6e6, 6e6}};
  EXPECT_THAT(refusal(VoxelGrid::covering(planet, 1e-9), k23GB), HasSubstr("are available"));
}

TEST(VoxelGrid, rejects_more_voxels_along_an_axis_than_the_kernels_support) {
  const VoxelGrid beam = VoxelGrid::covering({{0, 0, 0}, {40, 0.01, 0.01}}, 0.001);
  EXPECT_THAT(refusal(beam, k23GB), HasSubstr("at most 32,767 along an axis"));
}

/// A grid of 4 m whose last corner is at `x`.
VoxelGrid grid_up_to(double x, double voxel_m) {
  return VoxelGrid::covering({{x - 4, 0, 0}, {x, 4, 4}}, voxel_m);
}

TEST(VoxelGrid, rejects_a_space_where_positions_are_too_coarse_for_its_voxels) {
  const auto message = [](double x, double voxel_m) {
    return test::message_of<InputError>([&] { require_precision(grid_up_to(x, voxel_m)); });
  };
  EXPECT_EQ(message(500'000, 0.01),
            "bounds: they reach 500,000 m from the origin, where positions are rounded to 31.2 mm; "
            "expected at most 0.625 mm, a sixteenth of a voxel: choose an origin near the bounds, "
            "for the calibration, too");
  EXPECT_THAT(message(10'000, 0.01), HasSubstr("10,000 m"));
  EXPECT_THAT(message(-10'000, 0.01), HasSubstr("10,004 m"));
}

TEST(VoxelGrid, accepts_a_space_where_positions_are_fine_enough_for_its_voxels) {
  EXPECT_NO_THROW(require_precision(grid_up_to(10'000, 0.02)));
  EXPECT_NO_THROW(require_precision(grid_up_to(1'000, 0.002)));
  EXPECT_NO_THROW(require_precision(VoxelGrid::covering({{0, 0, 0}, {1e-3, 1e-3, 1e-3}}, 1e-6)));
}

}  // namespace
}  // namespace v3d::recon
