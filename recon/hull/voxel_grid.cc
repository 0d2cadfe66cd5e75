#include "recon/hull/voxel_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/core/error.h"
#include "base/core/units.h"

namespace v3d {
namespace {

constexpr double kMaxVoxels = 0x1p62;  // representable in int64_t and in double

constexpr double kSmallestVoxel = 1e-9;  // metres; keeps the arithmetic below free of underflow

/// Bytes of the whole grid at 1 bit a voxel. Computed in double, because the product of three
/// counts overflows 64 bits.
double bytes_of(const VoxelGrid& grid) {
  return static_cast<double>(grid.counts[0]) * static_cast<double>(grid.counts[1]) *
         static_cast<double>(grid.counts[2]) / 8;
}

bool fits(const VoxelGrid& grid, double bytes) {
  return bytes_of(grid) <= bytes && *std::ranges::max_element(grid.counts) <= VoxelGrid::kMaxCount;
}

/// The finest voxel of the series 1, 2, 5, 10, ... whose grid needs at most a tenth of the memory.
double suggested_voxel(const VoxelGrid& grid, double bytes_available) {
  const Eigen::Vector3d extent =
      grid.voxel_m * Eigen::Vector3d(grid.counts[0], grid.counts[1], grid.counts[2]);
  const Box box{grid.origin, grid.origin + extent};
  for (double decade = 1e-6; decade < 1e6; decade *= 10) {
    for (const double step : {1, 2, 5}) {
      if (fits(VoxelGrid::covering(box, step * decade), bytes_available / 10)) {
        return step * decade;
      }
    }
  }
  return extent.maxCoeff();
}

/// "3": at most three decimals, without trailing zeros.
std::string format_metres(double metres) {
  std::string text = std::to_string(std::round(metres * 1000) / 1000);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// "3 x 3 x 2 m is 30,000 x 30,000 x 20,000 voxels"
std::string describe(const VoxelGrid& grid) {
  std::string metres;
  std::string voxels;
  for (const int64_t count : grid.counts) {
    const std::string times = metres.empty() ? "" : " x ";
    metres += times + format_metres(static_cast<double>(count) * grid.voxel_m);
    voxels += times + format_count(count);
  }
  return format_length(grid.voxel_m) + " in " + metres + " m is " + voxels + " voxels";
}

}  // namespace

VoxelGrid VoxelGrid::covering(const Box& box, double voxel_m) {
  if (!(voxel_m >= kSmallestVoxel) || !std::isfinite(voxel_m)) {
    throw InputError("voxel size: must be a length of at least 1 nm");
  }
  VoxelGrid grid{box.min, voxel_m, {}};
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = box.size()[axis];
    if (!(extent > 0) || !std::isfinite(extent)) {
      throw InputError("bounds: the box has no extent along axis " + std::string(1, "xyz"[axis]) +
                       "; its minimum must be below its maximum");
    }
    const double count = std::ceil(extent / voxel_m - 1e-6);
    grid.counts[axis] = static_cast<int64_t>(std::clamp(count, 1.0, kMaxVoxels));
  }
  return grid;
}

void require_memory(const VoxelGrid& grid, double bytes_available) {
  const double bytes = bytes_of(grid);
  if (fits(grid, bytes_available)) return;
  const std::string advice =
      "; try " + format_length(suggested_voxel(grid, bytes_available)) + " voxels";
  if (bytes <= bytes_available) {
    throw InputError(describe(grid) + ", at most " + format_count(VoxelGrid::kMaxCount) +
                     " along an axis are possible" + advice);
  }
  throw InputError(describe(grid) + ", up to " + format_bytes(bytes) + " at 1 bit a voxel; " +
                   format_bytes(bytes_available) + " are available" + advice);
}

}  // namespace v3d
