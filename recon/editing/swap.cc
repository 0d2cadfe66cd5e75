#include "recon/editing/swap.h"

#include <algorithm>

#include "base/core/error.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Mean length of both legs, from hip to ankle along the bones, metres.
double leg_length(const SkeletonPulse& skeleton) {
  double sum = 0;
  for (const Joint joint : {kLeftKnee, kLeftAnkle, kRightKnee, kRightAnkle}) {
    sum += (skeleton.joints[joint] - skeleton.joints[parent(joint)]).norm();
  }
  return sum / 2;
}

/// The skeleton of a performer in the pose of an action. `own`: in a pose of the performer, who
/// holds a prop in `prop_hand`. `pelvis`: the result has it there.
SkeletonPulse posed(const SkeletonPulse& own, Joint prop_hand, const SkeletonPulse& action,
                    const Vector3d& pelvis) {
  SkeletonPulse result = action;
  result.joints[kPelvis] = pelvis;
  for (size_t j = 1; j < kJoints; ++j) {  // a parent has a lower number
    const Joint from = parent(static_cast<Joint>(j), prop_hand);
    const Matrix3d turn = result.rotations[from] * own.rotations[from].transpose();
    result.joints[j] = result.joints[from] + turn * (own.joints[j] - own.joints[from]);
    if (j < kBodyJoints) continue;
    result.rotations[j] = turn * own.rotations[j];
    result.confidence[j] = own.confidence[j];
  }
  return result;
}

}  // namespace

void swap_performer(Clip& clip, const Clip& performer, size_t shown) {
  V3D_CHECK(!clip.frames.empty() && shown < performer.frames.size());
  ClipFrame own = performer.frames[shown];
  clip.surfaces.assign(1, performer.surfaces[own.surface]);
  own.surface = 0;
  clip.prop_hand = performer.prop_hand;
  const SkeletonPulse& first = clip.frames.front().skeleton;
  const double scale = leg_length(own.skeleton) / std::max(leg_length(first), 1e-6);
  Vector3d centre = first.joints[kPelvis];
  centre.z() = 0;
  for (ClipFrame& frame : clip.frames) {
    const Vector3d pelvis = centre + scale * (frame.skeleton.joints[kPelvis] - centre);
    const SkeletonPulse skeleton = posed(own.skeleton, performer.prop_hand, frame.skeleton, pelvis);
    frame = own;
    pose(clip, frame, skeleton);
  }
}

}  // namespace v3d::recon
