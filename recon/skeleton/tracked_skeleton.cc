#include "recon/skeleton/tracked_skeleton.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

#include "base/core/statistics.h"
#include "base/geometry/rigid_transform.h"
#include "recon/skeleton/body_model.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Standard deviations, metres: of a joint as single pulses show it, of the motion of a part, of the
// middle of a limb whose radius is kLimbRadius; the latter grows with the fourth power of the
// radius.
constexpr double kPoseM = 0.04, kMotionM = 0.003, kRingM = 0.015;
constexpr double kLimbRadius = 0.04;  ///< share of the stature: at elbows, knees and ankles
constexpr double kIndependent = 10;   ///< pulses between independent errors of a motion
constexpr double kHeadTrust = 0.5;    ///< of the motion of the head against single pulses
constexpr size_t kMinRing = 6;        ///< edges between two parts that show their joint
constexpr double kConfidentM = 0.03;  ///< residual of a part

Vector3d median_position(const std::vector<Vector3d>& positions) {
  Vector3d result;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vector3d& position : positions) values.push_back(position[axis]);
    result[axis] = median(values);
  }
  return result;
}

/// A position of a joint at rest, and how far it is trusted: 0 where only the poses of single
/// pulses show it, near 1 where the motion of its parts does.
struct Centre {
  Vector3d position = Vector3d::Zero();
  double trust = 0;
};

struct TrackedJoints {
  RigidParts parts;
  std::vector<JointPositions> joints;  ///< [pulse]; none where no pose is known
  std::array<double, kJoints> trust{};
};

/// Finds the joints of one tracked surface.
class JointFinder {
 public:
  JointFinder(const TrackedBody& body, std::span<const JointPositions* const> poses,
              const KinematicStructure& structure)
      : body_(body),
        poses_(poses),
        structure_(structure),
        parts_(rigid_parts(body, poses, structure.outline, structure.has_prop)) {}

  /// Joints at all pulses of the surface; bones do not have equal lengths yet.
  TrackedJoints find() {
    result_.joints.resize(poses_.size());
    put(kNeck, kNeck, kHead, centre(kNeck, kNeck, kHead));
    put(kHead, kHead, kHead, {expected(kHead, kHead, kHead), kHeadTrust});
    for (const Joint joint : {kLeftShoulder, kLeftElbow, kRightShoulder, kRightElbow, kLeftHip,
                              kLeftKnee, kLeftAnkle, kRightHip, kRightKnee, kRightAnkle}) {
      const Joint above = parent_part(joint);
      put(joint, above, joint, centre(joint, above, joint));
    }
    put(kLeftWrist, kLeftElbow, kLeftElbow, wrist(kLeftWrist, kLeftElbow));
    put(kRightWrist, kRightElbow, kRightElbow, wrist(kRightWrist, kRightElbow));
    for (const Joint joint : {kPropBase, kPropTip}) {
      put(joint, kPropBase, kPropBase, {expected(joint, kPropBase, kPropBase), 0});
    }
    for (JointPositions& joints : result_.joints) place_pelvis(joints);
    result_.trust[kPelvis] = std::min(result_.trust[kLeftHip], result_.trust[kRightHip]);
    result_.parts = std::move(parts_);
    return std::move(result_);
  }

 private:
  /// The joint at all pulses, moved by parts `a` and `b`, as far as the centre is trusted.
  void put(Joint joint, Joint a, Joint b, const Centre& centre) {
    result_.trust[joint] = centre.trust;
    for (size_t p = 0; p < poses_.size(); ++p) {
      const PartMotion& motion = parts_.motions[p];
      Vector3d& position = result_.joints[p][joint];
      position = 0.5 * (motion[a] * centre.position + motion[b] * centre.position);
      if (poses_[p] != nullptr) position += (1 - centre.trust) * ((*poses_[p])[joint] - position);
    }
  }

  /// Where the poses show a joint, at rest: the median over the pulses, in the frames of two parts.
  Vector3d expected(Joint joint, Joint a, Joint b) const {
    std::vector<Vector3d> positions;
    for (size_t p = 0; p < poses_.size(); ++p) {
      if (poses_[p] == nullptr) continue;
      const Vector3d& position = (*poses_[p])[joint];
      positions.push_back(parts_.motions[p][a].inverse() * position);
      positions.push_back(parts_.motions[p][b].inverse() * position);
    }
    return median_position(positions);
  }

  /// A weighted sum of positions.
  struct Evidence {
    Matrix3d information = Matrix3d::Zero();  ///< 1 / m^2
    Vector3d weighted = Vector3d::Zero();
    void add(const Vector3d& position, double deviation_m) {
      information += Matrix3d::Identity() / (deviation_m * deviation_m);
      weighted += position / (deviation_m * deviation_m);
    }
    /// `position` is known across an axis only.
    void add_across(const Vector3d& axis, const Vector3d& position, double deviation_m) {
      const Matrix3d across =
          (Matrix3d::Identity() - axis * axis.transpose()) / (deviation_m * deviation_m);
      information += across;
      weighted += across * position;
    }
    Vector3d mean() const { return information.ldlt().solve(weighted); }
  };

  /// The middle of the limb where two parts meet, at rest; not where along the limb. Wide clothes
  /// count little.
  void add_ring(Joint a, Joint b, Evidence& evidence) const {
    std::vector<Vector3d> middles;
    const std::vector<Eigen::Vector3f>& positions = body_.surface.vertices;
    for (const auto& triangle : body_.surface.triangles) {
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = triangle[k], w = triangle[(k + 1) % 3];
        if (parts_.part_of[v] != a || parts_.part_of[w] != b) continue;
        middles.push_back(0.5 * (positions[v] + positions[w]).cast<double>());
      }
    }
    if (middles.size() < kMinRing) return;
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& middle : middles) centre += middle / static_cast<double>(middles.size());
    std::vector<double> radii;
    for (const Vector3d& middle : middles) radii.push_back((middle - centre).norm());
    const double limb_m = kLimbRadius * structure_.lengths.stature_m();
    const double deviation_m = kRingM * std::pow(std::max(1.0, percentile(radii, 0.9) / limb_m), 4);
    const Vector3d axis = (middle_of(b) - middle_of(a)).normalized();
    evidence.add_across(axis, centre, deviation_m);
  }

  /// Mean of the vertices of a part at rest.
  Vector3d middle_of(Joint part) const {
    Vector3d sum = Vector3d::Zero();
    for (size_t v = 0; v < parts_.part_of.size(); ++v) {
      if (parts_.part_of[v] == part) sum += body_.surface.vertices[v].cast<double>();
    }
    return sum / static_cast<double>(std::max<size_t>(parts_.count[part], 1));
  }

  /// The point that two parts move alike: the centre of rotation between them.
  void add_motion(Joint a, Joint b, Evidence& evidence) const {
    Evidence motion;
    motion.add(evidence.mean(), 1);  // so that all axes are known
    for (const PartMotion& pulse : parts_.motions) {
      const Matrix3d turn = pulse[a].linear() - pulse[b].linear();
      motion.information += turn.transpose() * turn;
      motion.weighted += turn.transpose() * (pulse[b].translation() - pulse[a].translation());
    }
    const Vector3d centre = motion.mean();
    double squares = kMotionM * kMotionM;
    for (const PartMotion& pulse : parts_.motions) {
      squares += (pulse[a] * centre - pulse[b] * centre).squaredNorm() /
                 static_cast<double>(parts_.motions.size());
    }
    evidence.information += motion.information / (kIndependent * squares);
    evidence.weighted += motion.weighted / (kIndependent * squares);
  }

  Centre centre(Joint joint, Joint a, Joint b) const {
    const bool is_hinge = joint == kLeftElbow || joint == kRightElbow || joint == kLeftKnee ||
                          joint == kRightKnee || joint == kLeftAnkle || joint == kRightAnkle;
    Evidence evidence;
    evidence.add(expected(joint, a, b), kPoseM);
    if (is_hinge) add_ring(a, b, evidence);
    add_motion(a, b, evidence);
    const double variance = evidence.information.inverse().trace() / 3;
    return {evidence.mean(), 1 - std::min(1.0, variance / (kPoseM * kPoseM))};
  }

  /// A wrist lies on the axis of the forearm. A hand on a prop shows it better.
  Centre wrist(Joint wrist, Joint elbow) const {
    if (structure_.has_prop || parts_.count[elbow] == 0) return {expected(wrist, elbow, elbow), 0};
    const Centre root = centre(elbow, parent_part(elbow), elbow);
    Vector3d sum = Vector3d::Zero();
    for (size_t v = 0; v < parts_.part_of.size(); ++v) {
      if (parts_.part_of[v] != elbow) continue;
      sum += body_.surface.vertices[v].cast<double>() - root.position;
    }
    const double length = structure_.lengths.between(elbow, wrist);
    return {root.position + length * sum.normalized(), root.trust};
  }

  /// The pelvis is above the middle between the hips, towards the neck.
  void place_pelvis(JointPositions& joints) const {
    const Vector3d middle = 0.5 * (joints[kLeftHip] + joints[kRightHip]);
    joints[kPelvis] = middle + proportions::kHipDrop * structure_.lengths.stature_m() *
                                   (joints[kNeck] - middle).normalized();
  }

  const TrackedBody& body_;
  std::span<const JointPositions* const> poses_;
  const KinematicStructure& structure_;
  RigidParts parts_;
  TrackedJoints result_;
};

TrackedJoints find_joints(const TrackedBody& body,
                          const std::map<int64_t, SkeletonPulse>& skeletons,
                          const KinematicStructure& structure) {
  std::vector<const JointPositions*> poses;
  for (const int64_t pulse : body.pulses) {
    const auto found = skeletons.find(pulse);
    poses.push_back(found != skeletons.end() ? &found->second.joints : nullptr);
  }
  if (std::ranges::count(poses, nullptr) == std::ssize(poses)) return {};
  return JointFinder(body, poses, structure).find();
}

/// The length of a bone: the mean over tracked surfaces of its median, and the proportional one as
/// far as its joints are not trusted.
double learnt_length(std::span<const TrackedJoints> tracked, const Bone& bone) {
  double sum = 0, weights = 0, pulses = 0;
  for (const TrackedJoints& body : tracked) {
    if (body.joints.empty()) continue;
    std::vector<double> metres;
    for (const JointPositions& pulse : body.joints) {
      metres.push_back((pulse[bone.a] - pulse[bone.b]).norm());
    }
    const auto count = static_cast<double>(metres.size());
    const double weight = count * body.trust[bone.a] * body.trust[bone.b];
    sum += weight * median(metres);
    weights += weight;
    pulses += count;
  }
  if (pulses == 0) return bone.metres;
  return (sum + (pulses - weights) * bone.metres) / pulses;
}

/// Learns the lengths of all bones; left and right are alike.
void learn_lengths(std::span<const TrackedJoints> tracked, BodyLengths& lengths) {
  std::map<double, std::vector<Bone*>> alike;  // bones of both sides have the same proportion
  for (Bone& bone : lengths.bones()) alike[bone.metres].push_back(&bone);
  for (const auto& [before, bones] : alike) {
    double mean = 0;
    for (const Bone* bone : bones) {
      mean += learnt_length(tracked, *bone) / static_cast<double>(bones.size());
    }
    for (Bone* bone : bones) bone->metres = mean;
  }
}

/// Rotations of a part around its joint, from rest to each pulse, in the least squares sense.
std::vector<Matrix3d> part_rotations(const TrackedBody& body, const RigidParts& parts, Joint part,
                                     std::span<const SkeletonPulse> pulses) {
  std::vector<Matrix3d> rotations(pulses.size());
  const Vector3d& joint_at_rest = pulses[body.rest].joints[part];
  tbb::parallel_for(size_t{0}, pulses.size(), [&](size_t p) {
    rotations[p] = parts.motions[p][part].linear();
    if (parts.count[part] == 0) return;
    Matrix3d sum = Matrix3d::Zero();
    for (size_t v = 0; v < parts.part_of.size(); ++v) {
      if (parts.part_of[v] != part) continue;
      sum += (body.positions[p][v].cast<double>() - pulses[p].joints[part]) *
             (body.surface.vertices[v].cast<double>() - joint_at_rest).transpose();
    }
    rotations[p] = nearest_rotation(sum);
  });
  return rotations;
}

/// Rotations of the parts, so that their means over the pulses are those of joint_rotations().
void add_rotations(const TrackedBody& body, const RigidParts& parts,
                   std::vector<SkeletonPulse>& pulses) {
  std::vector<std::array<Matrix3d, kJoints>> of_joints;
  for (const SkeletonPulse& pulse : pulses) of_joints.push_back(joint_rotations(pulse.joints));
  for (const Joint part : kPartJoints) {
    const std::vector<Matrix3d> turns = part_rotations(body, parts, part, pulses);
    Matrix3d sum = Matrix3d::Zero();
    for (size_t p = 0; p < pulses.size(); ++p) sum += turns[p].transpose() * of_joints[p][part];
    const Matrix3d rest = nearest_rotation(sum);
    for (size_t p = 0; p < pulses.size(); ++p) pulses[p].rotations[part] = turns[p] * rest;
  }
  for (SkeletonPulse& pulse : pulses) {
    pulse.rotations[kLeftWrist] = pulse.rotations[kLeftElbow];
    pulse.rotations[kRightWrist] = pulse.rotations[kRightElbow];
    pulse.rotations[kPropTip] = pulse.rotations[kPropBase];
  }
}

void add_confidences(const RigidParts& parts, std::vector<SkeletonPulse>& pulses) {
  for (size_t p = 0; p < pulses.size(); ++p) {
    for (size_t j = 0; j < kJoints; ++j) {
      const auto joint = static_cast<Joint>(j);
      const Joint part = moves_part(joint) ? joint : parent_part(joint);
      const double ratio = parts.residual_m[p][part] / kConfidentM;
      const auto count = static_cast<double>(parts.count[part]);
      pulses[p].confidence[j] = std::exp(-ratio * ratio) * count / (count + 100);
    }
  }
}

std::vector<SkeletonPulse> pulses_of(const TrackedBody& body, const TrackedJoints& tracked,
                                     const BodyLengths& lengths) {
  std::vector<SkeletonPulse> pulses(tracked.joints.size());
  for (size_t p = 0; p < pulses.size(); ++p) {
    pulses[p].joints = tracked.joints[p];
    restore_lengths(lengths, pulses[p].joints);
  }
  if (pulses.empty()) return pulses;
  add_rotations(body, tracked.parts, pulses);
  add_confidences(tracked.parts, pulses);
  return pulses;
}

/// Skeletons of the pulses of a structure, by pulse number.
std::map<int64_t, SkeletonPulse> by_number(const KinematicStructure& structure,
                                           std::span<const int64_t> numbers) {
  std::map<int64_t, SkeletonPulse> result;
  for (const SkeletonPulse& pulse : structure.pulses) result[numbers[pulse.index]] = pulse;
  return result;
}

}  // namespace

std::vector<Skin> learn_from_tracked(std::span<const TrackedBody> bodies,
                                     std::span<const int64_t> numbers,
                                     KinematicStructure& structure) {
  std::map<int64_t, SkeletonPulse> skeletons = by_number(structure, numbers);
  std::vector<TrackedJoints> tracked;
  for (const TrackedBody& body : bodies) tracked.push_back(find_joints(body, skeletons, structure));
  learn_lengths(tracked, structure.lengths);
  for (auto& [number, skeleton] : skeletons) {
    restore_lengths(structure.lengths, skeleton.joints);
    skeleton.rotations = joint_rotations(skeleton.joints);
  }
  std::vector<Skin> skins(bodies.size());
  for (size_t b = 0; b < bodies.size(); ++b) {
    std::vector<SkeletonPulse> pulses = pulses_of(bodies[b], tracked[b], structure.lengths);
    if (pulses.empty()) continue;
    skins[b] = fit_skin(bodies[b], tracked[b].parts, pulses);
    skins[b].poses = pulses;
    for (size_t p = 0; p < pulses.size(); ++p) skeletons[bodies[b].pulses[p]] = pulses[p];
  }
  structure.pulses.clear();
  for (size_t i = 0; i < numbers.size(); ++i) {
    const auto found = skeletons.find(numbers[i]);
    if (found == skeletons.end()) continue;
    structure.pulses.push_back(found->second);
    structure.pulses.back().index = i;
  }
  if (structure.has_prop) structure.prop_hand = hand_of_prop(structure.pulses);
  return skins;
}

}  // namespace v3d::recon
