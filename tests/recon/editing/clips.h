// Clips of a figure whose vertices are rigidly fixed to joints, for tests of editing.
#pragma once

#include "recon/editing/clip.h"
#include "recon/skeleton/body_model.h"

namespace v3d::recon::clips {

inline constexpr size_t kPerJoint = 4;  ///< vertices, at the corners of a small tetrahedron

/// The vertices of joint j are kPerJoint * j and the next ones.
inline ClipSurface surface(const SkeletonPulse& rest) {
  ClipSurface surface;
  surface.skin.rest = rest;
  for (uint32_t j = 0; j < kBodyJoints; ++j) {
    const auto joint = static_cast<Joint>(j);
    const Joint part = moves_part(joint) ? joint : parent_part(joint);
    SkinInfluence influence;
    influence.part.fill(part);
    influence.weight = {1, 0, 0, 0};
    for (size_t k = 0; k < kPerJoint; ++k) surface.skin.influences.push_back(influence);
    const auto v = static_cast<uint32_t>(kPerJoint * j);
    surface.triangles.push_back({v, v + 1, v + 2});
    surface.triangles.push_back({v, v + 2, v + 3});
    surface.triangles.push_back({v, v + 3, v + 1});
    surface.triangles.push_back({v + 1, v + 3, v + 2});
  }
  return surface;
}

inline ClipFrame frame(const SkeletonPulse& skeleton) {
  ClipFrame frame;
  frame.skeleton = skeleton;
  for (size_t j = 0; j < kBodyJoints; ++j) {
    for (const Eigen::Vector3d& corner :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.02, 0, 0), Eigen::Vector3d(0, 0.02, 0),
          Eigen::Vector3d(0, 0, 0.02)}) {
      const Eigen::Vector3d position = skeleton.joints[j] + skeleton.rotations[j] * corner;
      frame.positions.push_back(position.cast<float>());
    }
  }
  return frame;
}

inline SkeletonPulse standing(const Eigen::Vector3d& pelvis, double yaw) {
  SkeletonPulse skeleton;
  skeleton.joints = standing_pose(BodyLengths(1.75, 0.5), pelvis, yaw);
  skeleton.rotations = joint_rotations(skeleton.joints);
  return skeleton;
}

/// A person who glides from `pelvis` by `step` a frame, and looks at `yaw`; 25 frames a second.
inline Clip gliding(size_t frames, const Eigen::Vector3d& pelvis, const Eigen::Vector3d& step,
                    double yaw = 0) {
  Clip clip;
  clip.surfaces.push_back(surface(standing(pelvis, yaw)));
  for (size_t f = 0; f < frames; ++f) {
    clip.frames.push_back(frame(standing(pelvis + static_cast<double>(f) * step, yaw)));
  }
  return clip;
}

}  // namespace v3d::recon::clips
