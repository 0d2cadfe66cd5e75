#include "recon/motion/segment_tracker.h"

#include <array>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/motion/deformation_graph.h"
#include "recon/motion/position_filter.h"
#include "recon/motion/template_fit.h"
#include "recon/motion/template_surface.h"
#include "recon/texture/atlas_colours.h"

namespace v3d::recon {
namespace {

constexpr float kMinFacing = 0.25F;    ///< cosine between normal and direction to a camera
constexpr float kToleranceM = 0.015F;  ///< behind the surface in a depth buffer

}  // namespace

SurfaceSamples every_nth(const Mesh& mesh, std::span<const Eigen::Vector3f> normals, size_t n) {
  SurfaceSamples samples;
  for (size_t v = 0; v < mesh.vertices.size(); v += n) {
    samples.positions.push_back(mesh.vertices[v]);
    samples.normals.push_back(normals[v]);
  }
  return samples;
}

std::vector<uint8_t> visible_camera_counts(std::span<const Eigen::Vector3f> positions,
                                           std::span<const Eigen::Vector3f> normals,
                                           const SurfaceCameras& cameras,
                                           std::span<const DepthBuffer> depths) {
  std::vector<uint8_t> count(positions.size(), 0);
  for_each_block<VertexVisibility::kCapacity>(count.size(), [&](size_t begin, size_t end) {
    BlockVisibility block;
    block.compute(positions.subspan(begin, end - begin), normals.subspan(begin, end - begin),
                  cameras.cameras, depths, {.min_facing = kMinFacing, .tolerance_m = kToleranceM});
    for (size_t v = begin; v < end; ++v) {
      for (const VertexVisibility& camera : block.by_camera()) {
        count[v] = static_cast<uint8_t>(count[v] + (camera.seen[v - begin] >= kMinFacing ? 1 : 0));
      }
    }
  });
  return count;
}

ObservedSurface::ObservedSurface(std::shared_ptr<const ObservedPulse> pulse)
    : pulse_(std::move(pulse)), normals_(vertex_normals(pulse_->surface)), tree_(pulse_->surface) {}

std::optional<ObservedSurface::Nearest> ObservedSurface::nearest(const Eigen::Vector3f& position,
                                                                 double radius_m) const {
  const auto found = tree_.find(position.cast<double>());
  if (!found || found->distance > radius_m) return std::nullopt;
  const Mesh& mesh = pulse_->surface;
  return Nearest{
      interpolated(mesh, mesh.vertices, found->triangle, found->weights).cast<float>(),
      interpolated(mesh, normals_, found->triangle, found->weights).cast<float>().normalized()};
}

double ObservedSurface::distance(const Eigen::Vector3d& position) const {
  const auto found = tree_.find(position);
  return found ? found->distance : std::numeric_limits<double>::infinity();
}

namespace {

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

using Motion = std::vector<NodeMotion>;

/// A pulse that the template was fitted to.
struct FittedPulse {
  int64_t number = 0;
  Motion motion;
};

/// The template at a pulse, as its graph moves it.
struct PosedTemplate {
  std::vector<Vector3f> vertices, normals;

  explicit PosedTemplate(const TemplateFit& fit)
      : vertices(fit.vertices()), normals(fit.normals()) {}

  std::vector<Vector3f> displaced(const std::vector<float>& along_normals) const {
    std::vector<Vector3f> result(vertices.size());
    for_each_vertex(result.size(),
                    [&](size_t v) { result[v] = vertices[v] + along_normals[v] * normals[v]; });
    return result;
  }
};

/// For each node the candidate whose neighbourhood is nearest to the observed surface.
Motion nearest_of(const std::vector<Motion>& candidates, const ObservedSurface& now,
                  const std::vector<DeformationGraph::Edge>& edges) {
  constexpr int kSweeps = 4;
  std::vector<std::vector<double>> distances;
  for (const Motion& candidate : candidates) {
    std::vector<double> mean = TemplateFit::node_distances(now, candidate);
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      std::vector<double> sum = mean, count(mean.size(), 1);
      for (const DeformationGraph::Edge& edge : edges) {
        sum[edge.a] += mean[edge.b];
        sum[edge.b] += mean[edge.a];
        ++count[edge.a];
        ++count[edge.b];
      }
      for (size_t n = 0; n < mean.size(); ++n) mean[n] = sum[n] / count[n];
    }
    distances.push_back(std::move(mean));
  }
  Motion best(candidates[0].size());
  for (size_t n = 0; n < best.size(); ++n) {
    size_t nearest = 0;
    for (size_t c = 1; c < candidates.size(); ++c) {
      if (distances[c][n] < distances[nearest][n]) nearest = c;
    }
    best[n] = candidates[nearest][n];
  }
  return best;
}

/// Weighted mean of the displacements of each vertex, at rest.
class TemplateCorrection {
 public:
  explicit TemplateCorrection(size_t vertices)
      : sum_(vertices, Vector3f::Zero()), weight_(vertices, 0) {}

  void add(TemplateFit& fit, const Motion& motion, const NormalDisplacements& asked) {
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
  SegmentTracker(const PulseSource& source, size_t key, const TrackingOptions& options,
                 const SurfaceColours& colours)
      : source_(source),
        colours_(colours),
        key_(key),
        options_(options),
        fit_(simplified(source(key)->surface, options.triangles), options),
        first_(key),
        correction_(fit_.rest().vertices.size()) {}

  TrackedSegment run(size_t begin, size_t end, size_t limit) {
    const ObservedSurface key(source_(key_));
    fitted_.push_back({key.pulse().pulse, fit_.graph().rest_motion()});
    fit_.pose(key, fitted_[0].motion);
    learn(key, fitted_[0].motion);
    while (last() + 1 < end && has_surface(last() + 1) && follow(last(), 1)) {
    }
    while (first_ > begin && has_surface(first_ - 1) && follow(first_, -1)) {
    }
    const size_t own = fitted_.size();
    if (last() + 1 < limit && has_surface(last() + 1)) fit_next(last(), 1);
    if (options_.heterogeneity) learn_stiffness(fit_.graph(), motions(own));
    if (options_.fusion) correction_.apply(fit_.rest_vertices());
    TrackedSegment segment = second_pass();
    segment.shares_last = fitted_.size() > own;
    return segment;
  }

 private:
  size_t last() const { return first_ + fitted_.size() - 1; }
  const FittedPulse& fitted(size_t pulse) const { return fitted_[pulse - first_]; }

  /// What a fitted pulse shows.
  void learn(const ObservedSurface& now, const Motion& motion) {
    fit_.learn_patches(now);
    correction_.add(fit_, motion, fit_.normal_displacements(now, kFusionM));
  }

  bool has_surface(size_t pulse) const { return !source_(pulse)->surface.triangles.empty(); }
  bool is_tracked(size_t pulse) const { return pulse >= first_ && pulse <= last(); }

  /// Motion at the pulse after `from` in the direction `step`, before the fit.
  Motion predicted(const ObservedSurface& now, size_t from, ptrdiff_t step) {
    const size_t before = from - static_cast<size_t>(step);
    const FittedPulse& latest = fitted(from);
    if (!is_tracked(before)) return latest.motion;
    const auto elapsed = static_cast<double>(now.pulse().pulse - latest.number);
    const double ratio = elapsed / static_cast<double>(latest.number - fitted(before).number);
    return nearest_of({latest.motion, with_same_speed(fitted(before).motion, latest.motion, ratio)},
                      now, fit_.graph().edges());
  }

  /// Fits the pulse after `from` in the direction `step`, 1 or -1, and keeps its motion. Returns
  /// how well the template explains it.
  PulseResidual fit_next(size_t from, ptrdiff_t step) {
    const size_t next = from + static_cast<size_t>(step);
    now_.emplace(source_(next));
    FittedPulse pulse{now_->pulse().pulse, predicted(*now_, from, step)};
    fit_.fit(*now_, kFromPrediction, pulse.motion);
    if (step > 0) {
      fitted_.push_back(std::move(pulse));
    } else {
      fitted_.push_front(std::move(pulse));
      first_ = next;
    }
    return fit_.residual(*now_, options_.far_m);
  }

  /// As fit_next(), if the template explains the pulse. Otherwise false, and nothing is kept.
  bool follow(size_t from, ptrdiff_t step) {
    const PulseResidual residual = fit_next(from, step);
    if (residual.far > options_.max_far || residual.surplus > options_.max_surplus) {
      if (step > 0) {
        fitted_.pop_back();
      } else {
        fitted_.pop_front();
        first_ = from;
      }
      return false;
    }
    learn(*now_, fitted(from + static_cast<size_t>(step)).motion);
    return true;
  }

  /// The first `count` motions.
  std::vector<Motion> motions(size_t count) const {
    std::vector<Motion> result;
    for (size_t i = 0; i < count; ++i) result.push_back(fitted_[i].motion);
    return result;
  }

  /// Fits each pulse again, with the better template and stiffness.
  TrackedSegment second_pass() {
    TrackedSegment segment;
    ColourFilter filter;
    VertexConfidence confidence;
    std::vector<PosedTemplate> posed;
    std::vector<NormalDisplacements> details;
    segment.key = key_ - first_;
    segment.surface = fit_.rest();
    for (size_t i = 0; i < fitted_.size(); ++i) {
      const ObservedSurface now(source_(first_ + i));
      Motion motion = fitted_[i].motion;
      fit_.fit(now, kFromFirstPass, motion);
      segment.pulses.push_back(now.pulse().pulse);
      segment.residuals.push_back(fit_.residual(now, options_.far_m));
      details.push_back(fit_.normal_displacements(now, kDisplacementM));
      posed.emplace_back(fit_);
      segment.confidences.push_back(confidence.of_pulse(fit_, details.back()));
      if (!colours_) continue;
      const std::vector<Vector3f> seen = posed.back().displaced(fit_.displacements(details.back()));
      segment.colours.push_back(steady_colours(first_ + i, seen, filter));
    }
    const auto steady = steady_displacements(details, segment.pulses);
    for (size_t i = 0; i < posed.size(); ++i) {
      segment.positions.push_back(posed[i].displaced(fit_.displacements(steady[i])));
    }
    smooth_in_time(segment.positions, segment.pulses);
    return segment;
  }

  std::vector<Rgb8> steady_colours(size_t pulse, const std::vector<Vector3f>& positions,
                                   ColourFilter& filter) const {
    Mesh surface = fit_.rest();
    surface.vertices = positions;
    Texture texture = colours_(pulse, surface);
    filter.apply(texture.colours, texture.seen);
    return std::move(texture.colours);
  }

  const PulseSource& source_;
  const SurfaceColours& colours_;  ///< may be null
  const size_t key_;
  const TrackingOptions options_;
  TemplateFit fit_;
  size_t first_;                    ///< index of the pulse of fitted_[0]
  std::deque<FittedPulse> fitted_;  ///< ascending
  TemplateCorrection correction_;
  std::optional<ObservedSurface> now_;  ///< the pulse of the last fit_next()
};

}  // namespace

TrackedSegment track_segment(const PulseSource& source, size_t begin, size_t key, size_t end,
                             size_t limit, const TrackingOptions& options,
                             const SurfaceColours& colours) {
  V3D_CHECK(begin <= key && key < end && end <= limit);
  return SegmentTracker(source, key, options, colours).run(begin, end, limit);
}

}  // namespace v3d::recon
