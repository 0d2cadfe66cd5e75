#include "recon/editing/clip.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "base/core/error.h"

namespace v3d::recon {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::Vector3f;

void check_range(const Clip& clip, ClipRange range) {
  V3D_CHECK(range.first < range.last && range.last <= clip.frames.size());
}

bool hangs_on(Joint joint, Joint root, Joint prop_hand) {
  while (joint != root && joint != kPelvis) joint = parent(joint, prop_hand);
  return joint == root;
}

bool has_part_on(Joint joint, const Skin& skin, Joint prop_hand) {
  return std::ranges::any_of(skin.influences, [&](const SkinInfluence& influence) {
    for (size_t k = 0; k < SkinInfluence::kParts; ++k) {
      if (influence.weight[k] > 0 && hangs_on(influence.part[k], joint, prop_hand)) return true;
    }
    return false;
  });
}

/// The frame at a time between two frames of a range.
ClipFrame frame_at(const Clip& clip, size_t first, double time) {
  const auto before = static_cast<size_t>(time);
  const double share = time - static_cast<double>(before);
  const ClipFrame& a = clip.frames[first + before];
  if (share < 1e-9) return a;
  return frame_between(clip, a, clip.frames[first + before + 1], share);
}

Joint other_side(Joint joint) {
  switch (joint) {
    case kLeftShoulder:
      return kRightShoulder;
    case kLeftElbow:
      return kRightElbow;
    case kLeftWrist:
      return kRightWrist;
    case kRightShoulder:
      return kLeftShoulder;
    case kRightElbow:
      return kLeftElbow;
    case kRightWrist:
      return kLeftWrist;
    case kLeftHip:
      return kRightHip;
    case kLeftKnee:
      return kRightKnee;
    case kLeftAnkle:
      return kRightAnkle;
    case kRightHip:
      return kLeftHip;
    case kRightKnee:
      return kLeftKnee;
    case kRightAnkle:
      return kLeftAnkle;
    default:
      return joint;
  }
}

/// A reflection in a vertical plane.
struct Mirror {
  Vector3d centre = Vector3d::Zero(), normal = Vector3d::UnitY();
  Matrix3d linear() const { return Matrix3d::Identity() - 2 * normal * normal.transpose(); }
  Vector3d reflected(const Vector3d& p) const { return centre + linear() * (p - centre); }

  SkeletonPulse skeleton(const SkeletonPulse& pulse) const {
    const Matrix3d left_to_right = Vector3d(1, -1, 1).asDiagonal();
    SkeletonPulse result = pulse;
    for (size_t j = 0; j < kJoints; ++j) {
      const Joint to = other_side(static_cast<Joint>(j));
      result.joints[to] = reflected(pulse.joints[j]);
      result.rotations[to] = linear() * pulse.rotations[j] * left_to_right;
      result.confidence[to] = pulse.confidence[j];
    }
    return result;
  }
};

Mirror mirror_of(const Clip& clip) {
  Mirror mirror;
  Vector3d left = Vector3d::Zero();
  for (const ClipFrame& frame : clip.frames) {
    const JointPositions& joints = frame.skeleton.joints;
    mirror.centre += joints[kPelvis] / static_cast<double>(clip.frames.size());
    left += joints[kLeftHip] - joints[kRightHip];
  }
  left.z() = 0;
  if (left.norm() > 1e-6) mirror.normal = left.normalized();
  return mirror;
}

}  // namespace

std::optional<Joint> find_joint(std::string_view text) {
  for (size_t j = 0; j < kJoints; ++j) {
    if (name(static_cast<Joint>(j)) == text) return static_cast<Joint>(j);
  }
  return {};
}

double smooth_step(double t) {
  const double inside = std::clamp(t, 0.0, 1.0);
  return inside * inside * (3 - 2 * inside);
}

SkeletonPulse blended(const SkeletonPulse& a, const SkeletonPulse& b, double share) {
  SkeletonPulse result = a;
  for (size_t j = 0; j < kJoints; ++j) {
    result.joints[j] += share * (b.joints[j] - a.joints[j]);
    const Quaterniond from(a.rotations[j]), to(b.rotations[j]);
    result.rotations[j] = from.slerp(share, to).toRotationMatrix();
    result.confidence[j] = std::min(a.confidence[j], b.confidence[j]);
  }
  return result;
}

ClipFrame frame_between(const Clip& clip, const ClipFrame& a, const ClipFrame& b, double share) {
  ClipFrame result = share < 0.5 ? a : b;
  const SkeletonPulse skeleton = blended(a.skeleton, b.skeleton, share);
  if (a.surface != b.surface) {
    pose(clip, result, skeleton);
    return result;
  }
  for (size_t v = 0; v < result.positions.size(); ++v) {
    result.positions[v] =
        a.positions[v] + static_cast<float>(share) * (b.positions[v] - a.positions[v]);
  }
  result.skeleton = skeleton;
  return result;
}

void pose(const Clip& clip, ClipFrame& frame, const SkeletonPulse& skeleton) {
  const Skin& skin = clip.surfaces[frame.surface].skin;
  const PartMotion motion = part_motion(frame.skeleton, skeleton);
  frame.positions = skinned(skin, motion, frame.positions);
  frame.skeleton = skeleton;
}

void cut(Clip& clip, ClipRange range) {
  check_range(clip, range);
  const auto begin = clip.frames.begin();
  clip.frames = {begin + static_cast<std::ptrdiff_t>(range.first),
                 begin + static_cast<std::ptrdiff_t>(range.last)};
}

size_t stretched_frames(size_t frames, double factor) {
  return static_cast<size_t>(std::max(1.0, std::round(static_cast<double>(frames) * factor)));
}

namespace {

/// When the frame `n` of `wanted` shows an action of `count` frames, in these.
double time_of(size_t n, size_t wanted, size_t count) {
  if (wanted == 1) return 0;
  return static_cast<double>(n) * static_cast<double>(count - 1) / static_cast<double>(wanted - 1);
}

}  // namespace

size_t stretched_frame(size_t frames, double factor, size_t frame) {
  V3D_CHECK(frame < frames);
  const size_t wanted = stretched_frames(frames, factor);
  size_t last = 0;
  while (last + 1 < wanted && time_of(last + 1, wanted, frames) < static_cast<double>(frame) + 0.5)
    ++last;
  return last;
}

void stretch(Clip& clip, ClipRange range, double factor) {
  check_range(clip, range);
  V3D_CHECK(factor >= 0.1 && factor <= 10);
  const size_t count = range.last - range.first;
  const size_t wanted = stretched_frames(count, factor);
  std::vector<ClipFrame> frames;
  for (size_t n = 0; n < wanted; ++n) {
    frames.push_back(frame_at(clip, range.first, time_of(n, wanted, count)));
  }
  const auto first = clip.frames.begin() + static_cast<std::ptrdiff_t>(range.first);
  const auto last = clip.frames.begin() + static_cast<std::ptrdiff_t>(range.last);
  const auto after = clip.frames.erase(first, last);
  clip.frames.insert(after, std::make_move_iterator(frames.begin()),
                     std::make_move_iterator(frames.end()));
}

void mirror(Clip& clip) {
  const Mirror mirror = mirror_of(clip);
  for (ClipSurface& surface : clip.surfaces) {
    for (auto& triangle : surface.triangles) std::swap(triangle[1], triangle[2]);
    surface.skin.rest = mirror.skeleton(surface.skin.rest);
    for (SkinInfluence& influence : surface.skin.influences) {
      for (Joint& part : influence.part) part = other_side(part);
    }
  }
  for (ClipFrame& frame : clip.frames) {
    for (Vector3f& position : frame.positions) {
      position = mirror.reflected(position.cast<double>()).cast<float>();
    }
    frame.skeleton = mirror.skeleton(frame.skeleton);
  }
  clip.prop_hand = other_side(clip.prop_hand);
}

void bend(Clip& clip, const Bend& bend) {
  check_range(clip, bend.range);
  const auto ramp = static_cast<double>(bend.ramp) + 1;
  for (size_t f = bend.range.first; f < bend.range.last; ++f) {
    const size_t from_end = std::min(f - bend.range.first + 1, bend.range.last - f);
    const double share = bend.ramp == 0 ? 1 : smooth_step(static_cast<double>(from_end) / ramp);
    ClipFrame& frame = clip.frames[f];
    SkeletonPulse turned = frame.skeleton;
    const Vector3d& centre = frame.skeleton.joints[bend.joint];
    const Vector3d axis = frame.skeleton.rotations[bend.joint] * bend.axis;
    const Matrix3d turn = AngleAxisd(share * bend.radians, axis).toRotationMatrix();
    for (size_t j = 0; j < kJoints; ++j) {
      if (!hangs_on(static_cast<Joint>(j), bend.joint, clip.prop_hand)) continue;
      turned.joints[j] = centre + turn * (frame.skeleton.joints[j] - centre);
      turned.rotations[j] = turn * frame.skeleton.rotations[j];
    }
    pose(clip, frame, turned);
  }
}

bool moves_surface(const Clip& clip, Joint joint, ClipRange range) {
  check_range(clip, range);
  std::set<size_t> surfaces;
  for (size_t f = range.first; f < range.last; ++f) surfaces.insert(clip.frames[f].surface);
  return std::ranges::any_of(surfaces, [&](size_t surface) {
    return has_part_on(joint, clip.surfaces[surface].skin, clip.prop_hand);
  });
}

void carry_prop(Clip& clip, const SkeletonPulse& held, Joint hand) {
  clip.prop_hand = hand;
  const Matrix3d hand_from_world = held.rotations[hand].transpose();
  for (ClipFrame& frame : clip.frames) {
    SkeletonPulse& skeleton = frame.skeleton;
    const Matrix3d turn = skeleton.rotations[hand] * hand_from_world;
    for (const Joint joint : {kPropBase, kPropTip}) {
      skeleton.joints[joint] =
          skeleton.joints[hand] + turn * (held.joints[joint] - held.joints[hand]);
      skeleton.rotations[joint] = turn * held.rotations[joint];
      skeleton.confidence[joint] = 0;
    }
  }
}

namespace {

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
