#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/skeleton/tracked_skeleton.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kOwnPartM = 0.004;  ///< difference of two motions that does not count in a weight
constexpr int kSmoothing = 8;        ///< passes over the weights

/// Weights of the vertices of a tracked surface.
class SkinFitter {
 public:
  SkinFitter(const TrackedBody& body, const RigidParts& parts,
             std::span<const SkeletonPulse> pulses)
      : body_(body), parts_(parts) {
    skin_.rest = pulses[body.rest];
    for (const SkeletonPulse& pulse : pulses) motions_.push_back(part_motion(skin_.rest, pulse));
  }

  Skin fit() {
    std::vector<Weights> weights(body_.surface.vertices.size());
    tbb::parallel_for(size_t{0}, weights.size(), [&](size_t v) { weights[v] = fitted(v); });
    smooth(weights);
    for (const Weights& of_vertex : weights) skin_.influences.push_back(strongest(of_vertex));
    return std::move(skin_);
  }

 private:
  using Weights = std::array<float, kJoints>;

  /// The best blend of a vertex's own part with one that touches it.
  Weights fitted(size_t v) const {
    const Joint own = parts_.part_of[v];
    Joint best = own;
    double share = 0, most = 0;
    for (const Joint other : kPartJoints) {
      const bool touches = other != own && parts_.count[other] > 0 &&
                           (parent_part(other) == own || parent_part(own) == other);
      if (!touches) continue;
      const auto [weight, gain] = blend(v, own, other);
      if (gain <= most) continue;
      most = gain;
      share = weight;
      best = other;
    }
    Weights weights{};
    weights[own] = 1 - static_cast<float>(share);
    weights[best] += static_cast<float>(share);
    return weights;
  }

  /// Least squares weight of `other` in the path of a vertex, and by how much it lowers the sum of
  /// squares.
  std::pair<double, double> blend(size_t v, Joint own, Joint other) const {
    const Vector3d rest = body_.surface.vertices[v].cast<double>();
    double squares = kOwnPartM * kOwnPartM * static_cast<double>(motions_.size()), product = 0;
    for (size_t p = 0; p < motions_.size(); ++p) {
      const Vector3d position = motions_[p][own] * rest;
      const Vector3d difference = motions_[p][other] * rest - position;
      squares += difference.squaredNorm();
      product += difference.dot(body_.positions[p][v].cast<double>() - position);
    }
    const double weight = std::clamp(product / squares, 0.0, 1.0);
    return {weight, weight * (2 * product - weight * squares)};
  }

  void smooth(std::vector<Weights>& weights) const {
    const Neighbours neighbours(body_.surface);
    for (int pass = 0; pass < kSmoothing; ++pass) {
      const std::vector<Weights> before = weights;
      tbb::parallel_for(size_t{0}, weights.size(), [&](size_t v) {
        const auto around = neighbours.of(v);
        if (around.empty()) return;
        Weights mean{};
        for (const uint32_t n : around) {
          for (size_t j = 0; j < kJoints; ++j) {
            mean[j] += before[n][j] / static_cast<float>(around.size());
          }
        }
        for (size_t j = 0; j < kJoints; ++j) weights[v][j] = 0.5F * (before[v][j] + mean[j]);
      });
    }
  }

  static SkinInfluence strongest(const Weights& weights) {
    std::array<size_t, kJoints> order;
    for (size_t j = 0; j < kJoints; ++j) order[j] = j;
    std::ranges::stable_sort(order, [&](size_t a, size_t b) { return weights[a] > weights[b]; });
    SkinInfluence influence;
    float sum = 0;
    for (size_t k = 0; k < SkinInfluence::kParts; ++k) sum += weights[order[k]];
    for (size_t k = 0; k < SkinInfluence::kParts; ++k) {
      influence.part[k] = static_cast<Joint>(order[k]);
      influence.weight[k] = weights[order[k]] / sum;
    }
    return influence;
  }

  const TrackedBody& body_;
  const RigidParts& parts_;
  std::vector<PartMotion> motions_;  ///< [pulse]
  Skin skin_;
};

}  // namespace

PartMotion part_motion(const SkeletonPulse& from, const SkeletonPulse& to) {
  PartMotion motion;
  for (size_t j = 0; j < kJoints; ++j) {
    motion[j].setIdentity();
    motion[j].linear() = to.rotations[j] * from.rotations[j].transpose();
    motion[j].translation() = to.joints[j] - motion[j].linear() * from.joints[j];
  }
  return motion;
}

std::vector<Vector3f> skinned(const Skin& skin, const PartMotion& motion,
                              std::span<const Vector3f> positions) {
  V3D_CHECK(positions.size() == skin.influences.size());
  std::vector<Vector3f> moved(positions.size());
  tbb::parallel_for(size_t{0}, positions.size(), [&](size_t v) {
    const SkinInfluence& influence = skin.influences[v];
    Vector3d sum = Vector3d::Zero();
    for (size_t k = 0; k < SkinInfluence::kParts; ++k) {
      if (influence.weight[k] == 0) continue;
      sum +=
          double{influence.weight[k]} * (motion[influence.part[k]] * positions[v].cast<double>());
    }
    moved[v] = sum.cast<float>();
  });
  return moved;
}

Skin fit_skin(const TrackedBody& body, const RigidParts& parts,
              std::span<const SkeletonPulse> pulses) {
  return SkinFitter(body, parts, pulses).fit();
}

}  // namespace v3d::recon
