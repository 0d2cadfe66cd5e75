// Surface coverage and accuracy of a rig for sampled performers.
#pragma once

#include <array>
#include <vector>

#include "plan/action_samples.h"

namespace v3d::plan {

/// NaN for no values.
struct Percentiles {
  double p10 = 0, p50 = 0, p90 = 0;
};

/// Shares are 0 to 1, of the surface.
struct SurfaceCoverage {
  std::array<double, 4> share{};  ///< seen by 0, 1, 2, and by 3 or more cameras
  std::vector<double> camera;     ///< seen by each camera of the rig
  Percentiles mm_per_pixel;       ///< on the surface, of the best camera of each seen point
  Percentiles error_mm;           ///< root of variance_along() of the points that two cameras see
  Percentiles nearest_baseline_deg;  ///< smallest angle between the rays of two cameras at a point
  Percentiles widest_baseline_deg;   ///< largest angle
  double views_lost = 0;             ///< of all views of points, those that another performer hides
  double below_two = 0;  ///< seen by two cameras only where other performers hide nothing

  double two_or_more() const { return share[2] + share[3]; }
};

/// Measures the rig on the samples; lens models are used as they are. Cameras in parallel.
SurfaceCoverage measure_coverage(const std::vector<CameraModel>& rig, const ActionSamples& action);

}  // namespace v3d::plan
