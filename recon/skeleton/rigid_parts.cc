#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/core/error.h"
#include "base/geometry/rigid_transform.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/skeleton/pose_fit.h"
#include "recon/skeleton/tracked_skeleton.h"

namespace v3d::recon {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int kIterations = 6, kRelabelPasses = 4;
constexpr double kRobustM = 0.03;       ///< residual at which a vertex has half its weight
constexpr double kCapM = 0.06;          ///< residuals beyond count as this
constexpr double kPriorM = 0.02;        ///< cost of a part that no pulse suggests
constexpr double kNeighboursM = 0.012;  ///< cost of a part that no neighbour has
constexpr size_t kMinVertices = 12;     ///< of a part with a motion of its own
constexpr double kFootBegins = 0.93;    ///< position along the shin

/// The part that the surface near a capsule belongs to.
Joint part_of_capsule(size_t capsule, double along) {
  constexpr std::array kParts{kHead,      kNeck,          kPelvis,     kNeck,
                              kPelvis,    kNeck,          kPelvis,     kLeftShoulder,
                              kLeftElbow, kRightShoulder, kRightElbow, kLeftHip,
                              kLeftKnee,  kRightHip,      kRightKnee,  kPropBase};
  static_assert(kParts.size() == kPropCapsule + 1);
  const Joint part = kParts[capsule];
  const bool is_trunk = capsule == 2 || capsule == 4;
  if (is_trunk && along > 0.5) return kNeck;
  if (capsule == 1 && along > 0.5) return kHead;
  if (part == kLeftKnee && along > kFootBegins) return kLeftAnkle;
  if (part == kRightKnee && along > kFootBegins) return kRightAnkle;
  return part;
}

/// Weighted rigid motion from `from` to `to` (Kabsch 1976).
Isometry3d fitted_motion(std::span<const Vector3d> from, std::span<const Vector3d> to,
                         std::span<const double> weights) {
  Vector3d mean_from = Vector3d::Zero(), mean_to = Vector3d::Zero();
  double sum = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    mean_from += weights[i] * from[i];
    mean_to += weights[i] * to[i];
    sum += weights[i];
  }
  mean_from /= sum;
  mean_to /= sum;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < from.size(); ++i) {
    covariance += weights[i] * (to[i] - mean_to) * (from[i] - mean_from).transpose();
  }
  const Eigen::Matrix3d turn = nearest_rotation(covariance);
  Isometry3d motion = Isometry3d::Identity();
  motion.linear() = turn;
  motion.translation() = mean_to - turn * mean_from;
  return motion;
}

class PartFinder {
 public:
  PartFinder(const TrackedBody& body, std::span<const JointPositions* const> poses,
             std::span<const Capsule> outline, bool has_prop)
      : body_(body),
        poses_(poses),
        outline_(outline),
        has_prop_(has_prop),
        neighbours_(body.surface) {
    V3D_CHECK(poses.size() == body.positions.size());
  }

  RigidParts find() {
    vote();
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      fit_motions();
      relabel();
    }
    fit_motions();
    return std::move(parts_);
  }

 private:
  size_t vertices() const { return body_.surface.vertices.size(); }
  size_t pulses() const { return body_.positions.size(); }

  void vote() {
    const auto known = static_cast<float>(
        std::ranges::count_if(poses_, [](const JointPositions* pose) { return pose != nullptr; }));
    V3D_CHECK(known > 0);
    shares_.assign(vertices(), {});
    parts_.part_of.assign(vertices(), kPelvis);
    tbb::parallel_for(size_t{0}, vertices(), [&](size_t v) {
      std::array<float, kJoints>& shares = shares_[v];
      for (size_t p = 0; p < pulses(); ++p) {
        if (poses_[p] == nullptr) continue;
        shares[nearest_part(body_.positions[p][v].cast<double>(), *poses_[p])] += 1 / known;
      }
      const auto most = std::ranges::max_element(shares) - shares.begin();
      parts_.part_of[v] = static_cast<Joint>(most);
    });
  }

  Joint nearest_part(const Vector3d& position, const JointPositions& pose) const {
    double least = std::numeric_limits<double>::infinity();
    Joint part = kPelvis;
    for (size_t c = 0; c < outline_.size(); ++c) {
      if (c == kPropCapsule && !has_prop_) continue;
      const CapsuleDistance distance = distance_to(outline_[c], pose, position);
      const double outside = std::abs(distance.metres - outline_[c].radius(distance.along));
      if (outside >= least) continue;
      least = outside;
      part = part_of_capsule(c, distance.along);
    }
    return part;
  }

  void fit_motions() {
    std::array<std::vector<uint32_t>, kJoints> members;
    for (size_t v = 0; v < vertices(); ++v) {
      members[parts_.part_of[v]].push_back(static_cast<uint32_t>(v));
    }
    for (size_t j = 0; j < kJoints; ++j) parts_.count[j] = members[j].size();
    PartMotion none;
    none.fill(Isometry3d::Identity());
    parts_.motions.assign(pulses(), none);
    parts_.residual_m.assign(pulses(), {});
    tbb::parallel_for(size_t{0}, pulses(), [&](size_t p) {
      // Parents come before their children in kPartJoints.
      for (const Joint part : kPartJoints) {
        Isometry3d& motion = parts_.motions[p][part];
        if (members[part].size() < kMinVertices) {
          motion = part == kPelvis ? Isometry3d::Identity() : parts_.motions[p][parent_part(part)];
          continue;
        }
        motion = robust_motion(members[part], p, parts_.residual_m[p][part]);
      }
    });
  }

  Isometry3d robust_motion(const std::vector<uint32_t>& members, size_t pulse,
                           double& residual_m) const {
    std::vector<Vector3d> from, to;
    for (const uint32_t v : members) {
      from.push_back(body_.surface.vertices[v].cast<double>());
      to.push_back(body_.positions[pulse][v].cast<double>());
    }
    std::vector<double> weights(from.size(), 1);
    Isometry3d motion;
    for (int i = 0; i < 4; ++i) {
      motion = fitted_motion(from, to, weights);
      double sum = 0;
      for (size_t m = 0; m < from.size(); ++m) {
        const double squared = (motion * from[m] - to[m]).squaredNorm();
        const double ratio = 1 + squared / (kRobustM * kRobustM);
        weights[m] = 1 / (ratio * ratio);
        sum += std::min(squared, kCapM * kCapM);
      }
      residual_m = std::sqrt(sum / static_cast<double>(from.size()));
    }
    return motion;
  }

  /// Mean squared distance of the path of a vertex from the motion of a part.
  double path_error(size_t v, Joint part) const {
    const Vector3d rest = body_.surface.vertices[v].cast<double>();
    double sum = 0;
    for (size_t p = 0; p < pulses(); ++p) {
      const Vector3d position = body_.positions[p][v].cast<double>();
      sum += std::min((parts_.motions[p][part] * rest - position).squaredNorm(), kCapM * kCapM);
    }
    return sum / static_cast<double>(pulses());
  }

  void relabel() {
    std::vector<std::array<float, kJoints>> costs(vertices());
    tbb::parallel_for(size_t{0}, vertices(), [&](size_t v) {
      costs[v].fill(std::numeric_limits<float>::infinity());
      for (const Joint part : kPartJoints) {
        if (parts_.count[part] < kMinVertices) continue;
        costs[v][part] =
            static_cast<float>(path_error(v, part) + (1 - shares_[v][part]) * kPriorM * kPriorM);
      }
    });
    for (int pass = 0; pass < kRelabelPasses; ++pass) {
      const std::vector<Joint> before = parts_.part_of;
      tbb::parallel_for(size_t{0}, vertices(),
                        [&](size_t v) { parts_.part_of[v] = cheapest_part(v, costs[v], before); });
    }
  }

  Joint cheapest_part(size_t v, const std::array<float, kJoints>& costs,
                      const std::vector<Joint>& parts) const {
    std::array<float, kJoints> of_neighbours{};
    const auto neighbours = neighbours_.of(v);
    for (const uint32_t n : neighbours) of_neighbours[parts[n]] += 1;
    Joint best = parts[v];
    double least = std::numeric_limits<double>::infinity();
    for (const Joint part : kPartJoints) {
      // A vertex joins parts that touch it, or that are next to its own one.
      const bool is_near = part == parts[v] || of_neighbours[part] > 0;
      if (!is_near) continue;
      const double agree =
          neighbours.empty() ? 1 : of_neighbours[part] / static_cast<double>(neighbours.size());
      const double cost = costs[part] + (1 - agree) * kNeighboursM * kNeighboursM;
      if (cost >= least) continue;
      least = cost;
      best = part;
    }
    return best;
  }

  const TrackedBody& body_;
  std::span<const JointPositions* const> poses_;
  std::span<const Capsule> outline_;
  bool has_prop_;
  Neighbours neighbours_;
  std::vector<std::array<float, kJoints>> shares_;  ///< of the pulses that suggest a part
  RigidParts parts_;
};

}  // namespace

bool moves_part(Joint joint) { return std::ranges::find(kPartJoints, joint) != kPartJoints.end(); }

Joint parent_part(Joint part) {
  Joint above = parent(part);
  while (!moves_part(above)) above = parent(above);
  return above;
}

RigidParts rigid_parts(const TrackedBody& body, std::span<const JointPositions* const> poses,
                       std::span<const Capsule> outline, bool has_prop) {
  return PartFinder(body, poses, outline, has_prop).find();
}

}  // namespace v3d::recon
