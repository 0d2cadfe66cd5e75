#include "recon/hull/voxel_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"

namespace v3d::recon {
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

void require_precision(const VoxelGrid& grid) {
  constexpr double kVoxelShare = 1.0 / 16;
  using Single = std::numeric_limits<float>;
  double farthest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double end = grid.origin[axis] + static_cast<double>(grid.counts[axis]) * grid.voxel_m;
    farthest = std::max({farthest, std::abs(grid.origin[axis]), std::abs(end)});
  }
  const auto position = static_cast<float>(std::min(farthest, double{Single::max()}));
  const double step = double{std::nextafter(position, Single::infinity())} - double{position};
  const double largest_step = kVoxelShare * grid.voxel_m;
  if (step <= largest_step) return;
  constexpr double kMaxShown = 1e15;
  throw InputError("bounds: they reach " +
                   format_count(std::llround(std::min(farthest, kMaxShown))) +
                   " m from the origin, where positions are rounded to " + format_length(step) +
                   "; expected at most " + format_length(largest_step) +
                   ", a sixteenth of a voxel: choose an origin near the bounds, for the "
                   "calibration, too");
}

namespace {

enum { kK4 = 5, kTauX = 12 };

Lens lens_of(const CameraModel& camera) {
  if (camera.matrix()(0, 1) != 0) return Lens::kFull;
  if (!camera.has_distortion()) return Lens::kPinhole;
  const auto& d = camera.distortion();
  const bool simple = std::all_of(d.begin() + kK4, d.end(), [](double c) { return c == 0; });
  return simple ? Lens::kPolynomial : Lens::kFull;
}

bool is_small(const VoxelCamera& camera, const VoxelGrid& grid) {
  const auto max_index = static_cast<float>(*std::ranges::max_element(grid.counts));
  const auto below = [](float limit) { return [=](float v) { return std::abs(v) <= limit; }; };
  const auto& h = camera.pixel_from_lens;
  const auto& m = camera.cam_from_voxel;
  return std::all_of(camera.d.begin(), camera.d.end(), below(1e4F)) &&
         std::all_of(&h[0][0], &h[0][0] + 9, below(1e6F)) &&
         std::all_of(&m[0][0], &m[0][0] + 12, [&](float v) { return below(1e7F)(v * max_index); });
}

}  // namespace

VoxelCamera::VoxelCamera(const CameraModel& camera, const VoxelGrid& grid)
    : lens(lens_of(camera)),
      width(static_cast<float>(camera.size().width)),
      height(static_cast<float>(camera.size().height)),
      max_radius2(static_cast<float>(camera.max_radius2())) {
  const Eigen::Matrix3d axes = camera.cam_from_world().rotation * grid.voxel_m;
  const Eigen::Vector3d first = camera.cam_from_world() * grid.center(0, 0, 0);
  Eigen::Matrix3d lens_to_pixel = camera.matrix() * camera.tilt();
  lens_to_pixel.topRows<2>() += 0.5 * lens_to_pixel.row(2).replicate<2, 1>();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      cam_from_voxel[row][column] = static_cast<float>(axes(row, column));
      pixel_from_lens[row][column] = static_cast<float>(lens_to_pixel(row, column));
    }
    cam_from_voxel[row][3] = static_cast<float>(first[row]);
  }
  std::copy_n(camera.distortion().begin(), d.size(), d.begin());
  cannot_overflow = is_small(*this, grid);
}

namespace {

/// Slab test: true when the ray is between the two planes of every axis at one distance. A
/// direction component of 0 gives infinities, which are handled correctly. It gives NaN for a ray
/// in a plane; min and max ignore NaN.
bool meets(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, const Box& box) {
  double enter = 0;
  double leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.min[axis] - from[axis]) / direction[axis];
    const double b = (box.max[axis] - from[axis]) / direction[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave;
}

}  // namespace

Mask bounds_mask(const Box& box, const CameraModel& camera) {
  constexpr int kBlock = 4;
  const ImageSize size = camera.size();
  const Eigen::Vector3d from = camera.center();
  const auto corner_sees = [&](int column, int row) {
    const auto ray = camera.ray({kBlock * column - 0.5, kBlock * row - 0.5});
    return ray && meets(from, *ray, box);
  };
  const int columns = (size.width + kBlock - 1) / kBlock;
  const int rows = (size.height + kBlock - 1) / kBlock;
  const auto corner_row = [&](int row) {
    std::vector<char> sees;
    for (int column = 0; column <= columns; ++column) sees.push_back(corner_sees(column, row));
    return sees;
  };
  Mask view(size);
  std::vector<char> above = corner_row(0);
  for (int row = 0; row < rows; ++row) {
    std::vector<char> below = corner_row(row + 1);
    for (int i = 0; i < columns; ++i) {
      if (!above[i] && !above[i + 1] && !below[i] && !below[i + 1]) continue;
      for (int y = kBlock * row; y < std::min(kBlock * (row + 1), size.height); ++y) {
        view.fill_row(y, kBlock * i, std::min(kBlock * (i + 1), size.width));
      }
    }
    above = std::move(below);
  }
  return view;
}

}  // namespace v3d::recon
