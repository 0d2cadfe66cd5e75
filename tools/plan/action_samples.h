// The performer model of the planner: points of the surface of simulated performers at several
// moments of their action and several places of the space, and which of them a camera sees.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "sim/rendering/camera_images.h"

namespace v3d::plan {

// The performer model of the planner: points of the surface of simulated performers at several
// moments of their action and several places of the space.

enum class Cast : uint8_t { kSwordsman, kDuel };

/// All performers at one moment and one place. World frame, metres.
struct ActionMoment {
  sim::DrawList all;                     ///< all surfaces, which hide points
  std::vector<sim::DrawList> performer;  ///< the surfaces of each performer alone
  Box extent;                            ///< of all surfaces
};

/// A point of the outer surface of a performer, which can be seen from outside.
struct ActionSample {
  Eigen::Vector3f point;   ///< world, metres
  Eigen::Vector3f normal;  ///< outward, unit length
  uint32_t moment = 0;     ///< index in ActionSamples::moments
  uint32_t performer = 0;  ///< index in ActionMoment::performer
};

struct ActionOptions {
  Cast cast = Cast::kSwordsman;
  int moments = 60;
  int points = 120;   ///< at each moment
  uint64_t seed = 1;  ///< of times, places, directions and points
};

struct ActionSamples {
  std::vector<ActionMoment> moments;
  std::vector<ActionSample> samples;  ///< in the order of the moments
};

/// The z at which performers stand in `space`: 0 where the space contains it, otherwise its bottom.
double floor_of(const Box& space);

/// Moments are spread over the period of the action. At each of them the performers stand at
/// another place, at least kReachM from the sides of `space`, and turn to another direction; in a
/// narrow space they stand in its middle. Deterministic. Moments in parallel.
ActionSamples sample_action(const Box& space, const ActionOptions& options);
inline constexpr double kReachM = 0.6;

// Which points of the performers a position or a camera sees.

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
bool in_image(const CameraModel& camera, const ActionSample& sample);

}  // namespace v3d::plan
