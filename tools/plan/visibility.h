// Which points of the performers a position or a camera sees.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"
#include "plan/action_samples.h"

namespace v3d::plan {

/// A surface seen at a larger angle between its normal and the ray counts as not seen.
inline constexpr double kMaxIncidenceDeg = 75;

/// For each sample the cosine of the angle of incidence of the ray from `eye` (world, metres); 0
/// where another surface hides the sample or the angle exceeds kMaxIncidenceDeg.
///
/// `own_performer_only`: other performers hide nothing. Decides by depth rasters with pixels of
/// about 5 mm on the performer. Any thread.
std::vector<float> incidence_from(const Eigen::Vector3d& eye, const ActionSamples& action,
                                  bool own_performer_only = false);

/// Whether `camera` has the sample inside its image, disregarding other surfaces.
bool in_image(const CameraModel& camera, const SurfaceSample& sample);

}  // namespace v3d::plan
