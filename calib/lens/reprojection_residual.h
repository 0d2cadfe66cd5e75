// By how much one sighting of a board misses, and how that changes with the lens, the camera's
// place and the board's.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "base/camera_model.h"

namespace v3d::calib {

/// A pose: rotation vector, translation.
inline constexpr int kPoseSize = 6;
/// A lens: fx fy cx cy, then k1 k2 p1 p2 k3 k4 k5 k6, as far as they are free.
inline constexpr int kMostLensSize = 12;

/// Of all corners that one camera saw of one board at one instant.
///
/// Each corner has two misses with a slope by every number of the three blocks, but all of them
/// depend on the lens and on where the board stood in the camera alone, 18 numbers at most. So they
/// are condensed to a few that have, together with their slopes, the same sums of squares and of
/// products as those of all corners. A solver that asks for nothing else (Gauss, Newton) finds the
/// same step, and has a fifth of the rows to go through for a board of 54 corners.
class SightingMiss {
 public:
  /// `coefficients` of the lens are free: 4, 5 or 8 with the camera matrix, or 0: the lens is
  /// known. What is not free stays as `camera` has it. A corner that misses by more than
  /// `robust_px` pulls linearly instead of quadratically (Huber 1964), whatever the others do.
  SightingMiss(const CameraModel& camera, int coefficients, double robust_px);

  /// `corner`: in the frame of the board. `pixel`: where it was seen.
  void add(const Eigen::Vector3d& corner, const Eigen::Vector2d& pixel);

  int lens_size() const { return lens_size_; }  ///< of the block; 0: there is none
  int rows() const { return kPoseSize + lens_size_ + 2; }

  /// `blocks`: cam_from_world, world_from_board and, where it is free, the lens. `miss`: rows()
  /// numbers, whose squares add up to the corners' losses (pixels squared). `slopes`, unless null:
  /// by block, unless null, its rows() x size, row after row. False where a corner is not before
  /// the camera.
  bool evaluate(const double* const* blocks, double* miss, double** slopes) const;

 private:
  struct Corner {
    Eigen::Vector3d on_board;
    Eigen::Vector2d pixel;
  };
  struct Place;
  class Lens;
  template <int kLens>
  class Condenser;

  template <int kLens>
  bool condense(const Lens& lens, const Place& place, double* miss, double** slopes) const;
  bool sum_losses(const Lens& lens, const Place& place, double* miss) const;

  std::array<double, 16> known_lens_;  ///< with s1 s2 s3 s4
  double skew_;
  Eigen::Matrix3d tilt_;
  int lens_size_;
  double robust_px_;
  std::vector<Corner> corners_;
};

}  // namespace v3d::calib
