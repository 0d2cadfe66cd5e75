// Choice of cameras among candidates: greedy, then by exchange.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "base/geometry/camera_model.h"
#include "plan/action_samples.h"

namespace v3d::plan {

// Candidate cameras of a plan: positions around the space, directions and lenses.

/// What carries cameras.
enum class Mount : uint8_t {
  kWall,    ///< vertical walls at the margin around the sides of the space
  kRail,    ///< an ellipse inside these walls, which touches each in its middle
  kCeiling  ///< the horizontal rectangle inside these walls, at the largest height
};

struct MountOptions {
  std::vector<Mount> mounts = {Mount::kWall};
  double margin_m = 1.5;  ///< from the sides of the space to the walls
  double low_m = 0.3;     ///< heights above the floor
  double high_m = 2.5;
  double step_m = 0.5;  ///< between neighbouring positions
};

struct CandidateLenses {
  std::vector<double> focal_mm;
  double sensor_width_mm = 7.2;  ///< 1/1.8 inch, 4:3
  ImageSize size{1024, 768};
};

/// Positions on all mounts that are outside of `space`; world, metres. Their distance is about
/// the step, more around a large space. Empty where the space leaves no room below the ceiling.
std::vector<Eigen::Vector3d> candidate_positions(const Box& space, const MountOptions& options);

/// Points of the space to aim at: in its middle and at half the way to its sides, at three heights
/// of a performer.
std::vector<Eigen::Vector3d> candidate_targets(const Box& space);

/// An ideal camera without distortion, its principal point in the middle of the image.
CameraModel ideal_camera(const CandidateLenses& options, double focal_mm,
                         const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

// Choice of cameras: greedy, then by exchange.

/// The uncertainty at which a point has half of the value of its accuracy, metres.
inline constexpr double kTargetErrorM = 0.0015;
/// Standard deviation of a matched image position, pixels.
inline constexpr double kMatchingErrorPx = 0.3;

/// Information of a set of cameras about a point: the number of cameras that see it, and the
/// inverse covariance (1/m^2) of its triangulated position.
struct PointInformation {
  int cameras = 0;
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
};

/// Adds a camera, or removes it with `sign` -1. `to_point`: from the camera to the point, metres.
/// `weight` (1/m^2): (focal length in pixels / distance / kMatchingErrorPx)^2, times the cosine of
/// the angle of incidence, because a slanted surface has fewer pixels.
void add_camera(PointInformation& point, const Eigen::Vector3f& to_point, float weight,
                int sign = 1);

/// Variance, square metres, of the point along the unit vector `normal` of the surface, by
/// propagation of the matching error; infinite where fewer than two cameras see it.
/// Source: Olague and Mohr, Optimal camera placement for accurate reconstruction, Pattern
/// Recognition 35(4), 2002, sections 3 and 4.
float variance_along(const PointInformation& point, const Eigen::Vector3f& normal);

/// The value of a point, 0 to 1: kValueOfOne for one camera, kValueOfTwo for two or more. The rest
/// is for accuracy: (1 - kValueOfTwo) / (1 + variance_along() / kTargetErrorM^2).
inline constexpr float kValueOfOne = 0.1F;
inline constexpr float kValueOfTwo = 0.95F;
float value_of(const PointInformation& point, const Eigen::Vector3f& normal);

/// Least distance between two cameras, metres.
inline constexpr double kSeparationM = 0.3;

struct PlacementOptions {
  int cameras = 0;  ///< in all, with those of `fixed`
  CandidateLenses lens;
  MountOptions mounts;
  double separation_m = kSeparationM;  ///< between two cameras
  int max_exchanges = 4;               ///< passes over all cameras
};

struct CameraPlacement {
  std::vector<CameraModel> cameras;  ///< the chosen ones, without those of `fixed`
  std::vector<double> focal_mm;      ///< of each
  double greedy_value = 0;           ///< mean value of the samples after the greedy choice
  double value = 0;                  ///< after the exchanges
  double attainable = 0;  ///< share of the samples that two or more candidate positions see
  int candidates = 0;
  int exchanges = 0;
};

/// Chooses cameras that maximise the mean of value_of() over the samples.
///
/// Greedy: the candidate with the largest gain comes next. Exchange: each camera in turn is removed
/// and replaced by the best candidate, until no exchange gains. Deterministic. Candidates in
/// parallel. `progress` is called after each chosen camera. Throws InputError where the mounts have
/// fewer positions than cameras are needed.
/// Source: coverage as a set cover of sampled visibility, Erdem and Sclaroff, Automated camera
/// layout to satisfy task-specific and floor plan-specific coverage requirements, CVIU 103(3),
/// 2006; greedy set cover, Chvatal, Mathematics of Operations Research 4(3), 1979; exchange,
/// Fedorov, Theory of Optimal Experiments, 1972.
CameraPlacement place_cameras(const Box& space, const ActionSamples& action,
                              const std::vector<CameraModel>& fixed,
                              const PlacementOptions& options,
                              const std::function<void()>& progress);

}  // namespace v3d::plan
