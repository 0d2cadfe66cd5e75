// Time offsets of cameras that do not expose at the same instant, from the motion of a board.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "calib/rig/pair_poses.h"

namespace v3d::calib {

/// Largest offset that whole_time_offsets() searches, in either direction.
inline constexpr int kMaxTimeOffset = 5;

/// The time offset of each camera in whole instants, relative to the most frequent offset.
///
/// With a positive offset k, the camera's image labelled n shows instant n - k. Each camera is
/// compared with the cameras with which it shares most of `pairs`. Offsets can only be found where
/// the board moves and where instants are consecutive; otherwise the result is 0.
std::vector<int> whole_time_offsets(const std::vector<CandidatePoses>& cameras,
                                    const std::vector<PairPose>& pairs);

/// Turns observations of a board with half-turn symmetry so that a corner keeps its number from one
/// instant to the next: which end of the board comes first is arbitrary in each image.
void number_alike(const Board& board, CameraObservations& camera);

/// The image velocity of a corner, pixels per instant, by finite differences of neighbouring
/// instants. The corner has the same number in all of them (number_alike()). Empty where the camera
/// has no observation of a neighbouring instant.
std::optional<Eigen::Vector2d> corner_velocity(
    const std::map<int64_t, BoardObservation>& observations, int64_t instant, int corner);

/// A moving corner and its reprojection residual (observed minus projected).
struct MovingCorner {
  Eigen::Vector2d velocity;  ///< pixels per instant
  Eigen::Vector2d residual;  ///< pixels
};

/// The time offset of one camera as a fraction of an instant, by least squares.
///
/// Returns 0 where the motion explains less than a tenth of the squared residuals or less than
/// 0.02 px (RMS), where there are fewer than 50 corners, and where the corners hardly move.
double fractional_time_offset(std::span<const MovingCorner> corners);

}  // namespace v3d::calib
