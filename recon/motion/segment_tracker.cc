#include "recon/motion/segment_tracker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "recon/motion/observation.h"
#include "recon/motion/template_fit.h"
#include "recon/motion/template_surface.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr std::array kFromPrediction{
    FitStage{8, 0.15, 0.2, 20, 2, -1, true},
    FitStage{3, 0.08, 0.4, 10, 1, 0.056F, true},
    FitStage{2, 0.06, 0.5, 6, 0.6, 0.056F, true},
    FitStage{2, 0.04, 0.5, 4, 0.4, 0.02F, true},
    FitStage{2, 0.02, 0.6, 2, 0.2, 0.002F, false},
    FitStage{1, 0.015, 0.6, 0.5, 0.05, 0.002F, false},
};
constexpr std::array kFromFirstPass{
    FitStage{1, 0.02, 0.6, 2, 0.2, 0.002F, true},
    FitStage{1, 0.015, 0.6, 0.5, 0.05, 0.002F, false},
};

constexpr float kDisplacementM = 0.012F;  ///< largest displacement from the graph
constexpr float kFusionM = 0.04F;         ///< largest correction of the template

// Stiffness of an edge, by its root mean square deviation from a rigid motion.
constexpr double kRigidM = 0.002;  ///< deviation of stiffness 1
constexpr double kMaxStiffness = 10, kMinStiffness = 0.1;

/// Each node turns and moves on as it did.
std::vector<NodeMotion> extrapolated(const std::vector<NodeMotion>& before,
                                     const std::vector<NodeMotion>& now) {
  std::vector<NodeMotion> next(now.size());
  for (size_t n = 0; n < now.size(); ++n) {
    next[n].rotation = now[n].rotation * before[n].rotation.transpose() * now[n].rotation;
    next[n].place = 2 * now[n].place - before[n].place;
  }
  return next;
}

/// Weighted mean of the displacements of each vertex, at rest.
class TemplateCorrection {
 public:
  explicit TemplateCorrection(size_t vertices)
      : sum_(vertices, Vector3f::Zero()), weight_(vertices, 0) {}

  void add(TemplateFit& fit, const std::vector<NodeMotion>& motion,
           const NormalDisplacements& asked) {
    for_each_vertex(sum_.size(), [&](size_t v) {
      if (asked.weight[v] == 0) return;
      const Eigen::Matrix3f turned = fit.graph().rotation_at(motion, v).cast<float>();
      sum_[v] += asked.weight[v] * asked.target[v] * (turned.transpose() * fit.normals()[v]);
      weight_[v] += asked.weight[v];
    });
  }

  void apply(std::vector<Vector3f>& rest) const {
    constexpr float kMinWeight = 0.5F;
    for (size_t v = 0; v < rest.size(); ++v) {
      if (weight_[v] > kMinWeight) rest[v] += sum_[v] / weight_[v];
    }
  }

 private:
  std::vector<Vector3f> sum_;
  std::vector<float> weight_;
};

class SegmentTracker {
 public:
  SegmentTracker(const PulseSource& source, size_t key, const TrackingOptions& options)
      : source_(source),
        key_(key),
        options_(options),
        fit_(simplified(source(key)->surface, options.triangles), options),
        first_(key),
        correction_(fit_.rest().vertices.size()) {
    motions_.push_back(fit_.graph().rest_motion());
  }

  TrackedSegment run(size_t begin, size_t end) {
    const ObservedSurface key(source_(key_));
    fit_.pose(key, motions_[0]);
    learn(key, motions_[0]);
    while (last() + 1 < end && follow(last() + 1, last(), last() - 1)) {
    }
    while (first_ > begin && follow(first_ - 1, first_, first_ + 1)) {
    }
    if (options_.heterogeneity) learn_stiffness();
    if (options_.fusion) correction_.apply(fit_.rest_vertices());
    return second_pass();
  }

 private:
  size_t last() const { return first_ + motions_.size() - 1; }
  const std::vector<NodeMotion>& motion_of(size_t pulse) const { return motions_[pulse - first_]; }

  /// What a fitted pulse shows.
  void learn(const ObservedSurface& now, const std::vector<NodeMotion>& motion) {
    fit_.learn_patches(now);
    correction_.add(fit_, motion, fit_.normal_displacements(now, kFusionM));
  }

  /// Fits pulse `next` from the motion of `from` and, if it was tracked, `before`. False when the
  /// template does not explain the pulse.
  bool follow(size_t next, size_t from, size_t before) {
    const ObservedSurface now(source_(next));
    if (now.mesh().triangles.empty()) return false;
    std::vector<NodeMotion> motion = motion_of(from);
    if (before >= first_ && before <= last()) {
      std::vector<NodeMotion> predicted = extrapolated(motion_of(before), motion);
      if (TemplateFit::misfit(now, predicted) < TemplateFit::misfit(now, motion)) {
        motion = std::move(predicted);
      }
    }
    fit_.fit(now, kFromPrediction, motion);
    const PulseResidual residual = fit_.residual(now, options_.far_m);
    if (residual.far > options_.max_far || residual.surplus > options_.max_surplus) return false;
    learn(now, motion);
    if (next > from) {
      motions_.push_back(std::move(motion));
    } else {
      motions_.push_front(std::move(motion));
      first_ = next;
    }
    return true;
  }

  void learn_stiffness() {
    for (DeformationGraph::Edge& edge : fit_.graph().edges()) {
      const Vector3d rest = fit_.graph().rest()[edge.b] - fit_.graph().rest()[edge.a];
      double sum = 0;
      for (const std::vector<NodeMotion>& motion : motions_) {
        const NodeMotion& a = motion[edge.a];
        const NodeMotion& b = motion[edge.b];
        sum += (a.rotation * rest + a.place - b.place).squaredNorm();
        sum += (b.rotation * rest + a.place - b.place).squaredNorm();
      }
      const double square = sum / (2 * static_cast<double>(motions_.size()));
      edge.stiffness =
          static_cast<float>(std::clamp(kRigidM * kRigidM / square, kMinStiffness, kMaxStiffness));
    }
  }

  /// Fits each pulse again, with the better template and stiffness.
  TrackedSegment second_pass() {
    TrackedSegment segment;
    segment.key = key_ - first_;
    segment.surface = fit_.rest();
    for (size_t i = 0; i < motions_.size(); ++i) {
      const ObservedSurface now(source_(first_ + i));
      std::vector<NodeMotion> motion = motions_[i];
      fit_.fit(now, kFromFirstPass, motion);
      segment.pulses.push_back(now.pulse().pulse);
      segment.residuals.push_back(fit_.residual(now, options_.far_m));
      segment.positions.push_back(fit_.displaced(fit_.normal_displacements(now, kDisplacementM)));
      segment.confidences.push_back(confidence());
    }
    return segment;
  }

  std::vector<uint8_t> confidence() const {
    constexpr int kPerCamera = 85;  // three cameras give full confidence
    const std::vector<uint8_t>& cameras = fit_.visible_cameras();
    std::vector<uint8_t> confidence(cameras.size());
    for (size_t v = 0; v < cameras.size(); ++v) {
      confidence[v] = static_cast<uint8_t>(std::min(cameras[v] * kPerCamera, 255));
    }
    return confidence;
  }

  const PulseSource& source_;
  const size_t key_;
  const TrackingOptions options_;
  TemplateFit fit_;
  size_t first_;                                 ///< pulse of motions_[0]
  std::deque<std::vector<NodeMotion>> motions_;  ///< [pulse - first_][node]
  TemplateCorrection correction_;
};

}  // namespace

TrackedSegment track_segment(const PulseSource& source, size_t begin, size_t key, size_t end,
                             const TrackingOptions& options) {
  V3D_CHECK(begin <= key && key < end);
  return SegmentTracker(source, key, options).run(begin, end);
}

}  // namespace v3d::recon
