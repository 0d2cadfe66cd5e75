// The skeleton of a person who turns, with hand-made tracked surfaces or none.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/skeleton/body_model.h"
#include "recon/skeleton/tracked_skeleton.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::test {

/// A person who stands at (1, 2), and turns by 0.5 rad a pulse.
inline ctl::TakeSkeleton turning(size_t pulses) {
  ctl::TakeSkeleton skeleton;
  skeleton.rate_hz = 25;
  skeleton.structure.lengths = recon::BodyLengths(1.75, 0.5);
  for (size_t n = 0; n < pulses; ++n) {
    skeleton.pulses.push_back(static_cast<int64_t>(10 + n));
    recon::SkeletonPulse pulse;
    pulse.index = n;
    pulse.joints = recon::standing_pose(skeleton.structure.lengths, {1, 2, 0.93},
                                        0.5 * static_cast<double>(n));
    pulse.rotations = recon::joint_rotations(pulse.joints);
    skeleton.structure.pulses.push_back(pulse);
  }
  return skeleton;
}

/// Adds a segment whose surface is a triangle of the left forearm, at the pulses from `first` on.
inline void add_forearm(std::span<const recon::SkeletonPulse> poses, size_t first,
                        ctl::TakeSkeleton& skeleton) {
  recon::Skin& skin = skeleton.skins.emplace_back();
  skin.rest = poses[1];
  skin.poses.assign(poses.begin(), poses.end());
  skin.influences.assign(3, {.part = {recon::kLeftElbow}, .weight = {1, 0, 0, 0}});
  recon::TrackedBody& body = skeleton.tracked.emplace_back();
  body.rest = 1;
  body.colours.resize(poses.size());
  const Eigen::Vector3d& elbow = skin.rest.joints[recon::kLeftElbow];
  for (int axis = 0; axis < 3; ++axis) {
    body.surface.vertices.push_back((elbow + 0.1 * Eigen::Vector3d::Unit(axis)).cast<float>());
  }
  body.surface.triangles = {{0, 1, 2}};
  for (size_t p = 0; p < poses.size(); ++p) {
    body.pulses.push_back(skeleton.pulses[first + p]);
    body.positions.push_back(
        recon::skinned(skin, recon::part_motion(skin.rest, poses[p]), body.surface.vertices));
  }
}

/// turning(5) with two segments, of which the first ends and the second begins at the third pulse.
/// The second one, and so the structure, has a left elbow there that is turned by another 2 rad.
inline ctl::TakeSkeleton with_a_shared_pulse() {
  ctl::TakeSkeleton skeleton = turning(5);
  std::vector<recon::SkeletonPulse>& poses = skeleton.structure.pulses;
  add_forearm(std::span(poses).first(3), 0, skeleton);
  Eigen::Matrix3d& elbow = poses[2].rotations[recon::kLeftElbow];
  elbow = Eigen::Matrix3d(elbow * Eigen::AngleAxisd(2, Eigen::Vector3d::UnitX()));
  add_forearm(std::span(poses).last(3), 2, skeleton);
  return skeleton;
}

}  // namespace v3d::test
