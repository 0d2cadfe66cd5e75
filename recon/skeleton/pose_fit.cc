#include "recon/skeleton/pose_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <utility>

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

constexpr int kUnknowns = 3 * static_cast<int>(kJoints);
constexpr double kRobustM = 0.03;      ///< distance at which a point has half its weight
constexpr double kPointsWeight = 120;  ///< of all points
constexpr double kLengthWeight = 4000;
constexpr double kTorsoWeight = 100;  ///< of the distances between shoulders and pelvis
constexpr double kBendWeight = 1.5;
constexpr double kAcrossWeight = 8;
constexpr double kDamping = 0.05;

/// Normal equations over the positions of all joints.
class Normals {
 public:
  Normals() : matrix_(Eigen::MatrixXd::Zero(kUnknowns, kUnknowns)), right_(kUnknowns) {
    right_.setZero();
  }

  using Term = std::pair<Joint, Vector3d>;  ///< joint and gradient of the residual
  void add(std::span<const Term> terms, double residual, double weight) {
    for (const auto& [a, of_a] : terms) {
      right_.segment<3>(3 * static_cast<int>(a)) -= weight * residual * of_a;
      for (const auto& [b, of_b] : terms) {
        matrix_.block<3, 3>(3 * static_cast<int>(a), 3 * static_cast<int>(b)) +=
            weight * of_a * of_b.transpose();
      }
    }
  }
  void add(std::initializer_list<Term> terms, double residual, double weight) {
    add(std::span(terms.begin(), terms.size()), residual, weight);
  }
  /// The joint should be at `position`.
  void attract(Joint joint, const Vector3d& from, const Vector3d& position, double weight) {
    for (int axis = 0; axis < 3; ++axis) {
      add({{joint, Vector3d::Unit(axis)}}, from[axis] - position[axis], weight);
    }
  }
  Eigen::VectorXd step() {
    matrix_.diagonal().array() += kDamping;
    return matrix_.ldlt().solve(right_);
  }

 private:
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd right_;
};

struct Nearest {
  size_t capsule = 0;
  CapsuleDistance distance;
};

class Fit {
 public:
  Fit(const PoseProblem& problem, const BodyLengths& lengths, std::span<const Capsule> outline,
      const JointPositions& start)
      : problem_(problem), lengths_(lengths), outline_(outline), joints_(start) {}

  void step() {
    Normals normals;
    add_points(normals);
    add_lengths(normals);
    add_bends(normals);
    for (const JointTarget& target : problem_.targets) {
      normals.attract(target.joint, joints_[target.joint], target.position, target.weight);
    }
    for (size_t j = 0; j < kJoints; ++j) {
      normals.attract(static_cast<Joint>(j), joints_[j], problem_.expected[j],
                      problem_.expected_weight);
    }
    const Eigen::VectorXd step = normals.step();
    for (size_t j = 0; j < kJoints; ++j) {
      Vector3d move = step.segment<3>(3 * static_cast<int>(j));
      const double metres = move.norm();
      if (metres > 0.1) move *= 0.1 / metres;
      joints_[j] += move;
    }
  }

  FittedPose result() const {
    FittedPose fitted;
    fitted.joints = joints_;
    for (const OutlinePoint& point : problem_.points) {
      const Nearest nearest = nearest_capsule(point);
      const Capsule& capsule = outline_[nearest.capsule];
      const double residual = nearest.distance.metres - capsule.radius(nearest.distance.along);
      const Capsule::End& end = nearest.distance.along < 0.5 ? capsule.a : capsule.b;
      for (size_t k = 0; k < 3; ++k) {
        if (end.weight[k] < 0.15) continue;
        fitted.residual_m[end.joint[k]] += residual * residual;
        ++fitted.support[end.joint[k]];
      }
    }
    for (size_t j = 0; j < kJoints; ++j) {
      const auto count = static_cast<double>(std::max<size_t>(fitted.support[j], 1));
      fitted.residual_m[j] = std::sqrt(fitted.residual_m[j] / count);
    }
    return fitted;
  }

 private:
  Nearest nearest_capsule(const OutlinePoint& point) const {
    if (point.capsule != OutlinePoint::kAnyCapsule) {
      const auto only = static_cast<size_t>(point.capsule);
      return {only, distance_to(outline_[only], joints_, point.position)};
    }
    Nearest nearest;
    double least = std::numeric_limits<double>::infinity();
    for (size_t c = 0; c < kPropCapsule; ++c) {
      const CapsuleDistance distance = distance_to(outline_[c], joints_, point.position);
      const double outside = distance.metres - outline_[c].radius(distance.along);
      if (std::abs(outside) >= least) continue;
      least = std::abs(outside);
      nearest = {c, distance};
    }
    return nearest;
  }

  void add_points(Normals& normals) const {
    const double weight =
        kPointsWeight / static_cast<double>(std::max<size_t>(problem_.points.size(), 1));
    for (const OutlinePoint& point : problem_.points) {
      const auto [c, distance] = nearest_capsule(point);
      if (distance.metres < 1e-6) continue;
      const Capsule& capsule = outline_[c];
      const double residual = distance.metres - capsule.radius(distance.along);
      const Vector3d axis =
          (1 - distance.along) * capsule.a.at(joints_) + distance.along * capsule.b.at(joints_);
      const Vector3d away = (axis - point.position) / distance.metres;
      std::array<Normals::Term, 6> terms;
      for (size_t k = 0; k < 3; ++k) {
        terms[k] = {capsule.a.joint[k], (1 - distance.along) * capsule.a.weight[k] * away};
        terms[3 + k] = {capsule.b.joint[k], distance.along * capsule.b.weight[k] * away};
      }
      const double ratio = residual / kRobustM;
      const double robust = 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
      normals.add(terms, residual, weight * robust);
    }
  }

  void add_length(Normals& normals, Joint a, Joint b, double metres, double weight) const {
    const Vector3d along = joints_[a] - joints_[b];
    const double now = along.norm();
    if (now < 1e-6) return;
    normals.add({{a, along / now}, {b, -along / now}}, now - metres, weight);
  }

  void add_lengths(Normals& normals) const {
    for (const Bone& bone : lengths_.bones()) {
      if (bone.a == kPropBase && !problem_.has_prop) continue;
      add_length(normals, bone.a, bone.b, bone.metres, kLengthWeight);
    }
    using namespace proportions;
    const double h = lengths_.stature_m();
    const double spine = lengths_.between(kPelvis, kNeck);
    const double to_shoulder = std::hypot(kShoulderHalf * h, spine - kShoulderDrop * h);
    const double to_hip = std::hypot(kHipHalf * h, spine + kHipDrop * h);
    for (const Joint shoulder : {kLeftShoulder, kRightShoulder}) {
      add_length(normals, kPelvis, shoulder, to_shoulder, kTorsoWeight);
    }
    for (const Joint hip : {kLeftHip, kRightHip}) {
      add_length(normals, kNeck, hip, to_hip, kTorsoWeight);
    }
    for (const auto& [hip, shoulder] :
         {std::pair{kLeftHip, kLeftShoulder}, std::pair{kRightHip, kRightShoulder}}) {
      const double metres =
          std::hypot((kShoulderHalf - kHipHalf) * h, spine + (kHipDrop - kShoulderDrop) * h);
      add_length(normals, hip, shoulder, metres, kTorsoWeight);
    }
  }

  /// The joint in the middle of a limb should lie on this side of the line between its ends.
  void add_bend(Normals& normals, Joint root, Joint middle, Joint tip, const Vector3d& side,
                double share) const {
    const Vector3d line = joints_[tip] - joints_[root];
    const double length = line.norm();
    if (length < 1e-6) return;
    const double upper = lengths_.between(root, middle), lower = lengths_.between(middle, tip);
    const double along =
        std::clamp((upper * upper - lower * lower + length * length) / (2 * length), 0.0, upper);
    const double aside = std::sqrt(std::max(0.0, upper * upper - along * along));
    Vector3d bend = side - side.dot(line) / (length * length) * line;
    if (bend.norm() < 1e-6) return;
    bend.normalize();
    const Vector3d position = joints_[root] + along / length * line + aside * bend;
    normals.attract(middle, joints_[middle], position, share * kBendWeight);
  }

  void add_bends(Normals& normals) const {
    const Vector3d up = (joints_[kNeck] - joints_[kPelvis]).normalized();
    const Vector3d left =
        (joints_[kLeftShoulder] - joints_[kRightShoulder] + joints_[kLeftHip] - joints_[kRightHip])
            .normalized();
    const Vector3d forward = left.cross(up).normalized();
    add_bend(normals, kLeftHip, kLeftKnee, kLeftAnkle, forward + 0.2 * left, 1);
    add_bend(normals, kRightHip, kRightKnee, kRightAnkle, forward - 0.2 * left, 1);
    add_bend(normals, kLeftShoulder, kLeftElbow, kLeftWrist, left - up - 0.3 * forward, 1);
    add_bend(normals, kRightShoulder, kRightElbow, kRightWrist, -left - up - 0.3 * forward, 1);
    if (problem_.towards_hands) {
      const Vector3d across = *problem_.towards_hands;
      normals.add({{kLeftShoulder, across}, {kRightShoulder, -across}},
                  (joints_[kLeftShoulder] - joints_[kRightShoulder]).dot(across), kAcrossWeight);
    }
  }

  const PoseProblem& problem_;
  const BodyLengths& lengths_;
  std::span<const Capsule> outline_;
  JointPositions joints_;
};

}  // namespace

CapsuleDistance distance_to(const Capsule& capsule, const JointPositions& joints,
                            const Vector3d& position) {
  const Vector3d a = capsule.a.at(joints), along = capsule.b.at(joints) - a;
  const double squared = along.squaredNorm();
  const double t =
      squared > 1e-12 ? std::clamp((position - a).dot(along) / squared, 0.0, 1.0) : 0.0;
  return {t, (position - a - t * along).norm()};
}

FittedPose fit_pose(const PoseProblem& problem, const BodyLengths& lengths,
                    std::span<const Capsule> outline, const JointPositions& start, int iterations) {
  Fit fit(problem, lengths, outline, start);
  for (int i = 0; i < iterations; ++i) fit.step();
  return fit.result();
}

void restore_lengths(const BodyLengths& lengths, JointPositions& joints) {
  constexpr int kSweeps = 40;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (const Bone& bone : lengths.bones()) {
      const Vector3d along = joints[bone.b] - joints[bone.a];
      const double now = along.norm();
      if (now < 1e-9) continue;
      const Vector3d half = 0.5 * (bone.metres - now) / now * along;
      joints[bone.a] -= half;
      joints[bone.b] += half;
    }
  }
  const JointPositions before = joints;
  for (size_t j = 0; j < kJoints; ++j) {
    const auto joint = static_cast<Joint>(j);
    const Joint from = parent(joint);
    if (from == joint || joint == kPropBase) continue;
    const Vector3d along = before[joint] - before[from];
    if (along.norm() < 1e-9) continue;
    joints[joint] = joints[from] + lengths.between(from, joint) * along.normalized();
  }
}

}  // namespace v3d::recon
