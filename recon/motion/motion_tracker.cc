#include "recon/motion/motion_tracker.h"

#include <algorithm>
#include <utility>

#include "recon/motion/observation.h"
#include "recon/pipeline/compact_frame.h"

namespace v3d::recon {
namespace {

/// Penalties of the score, square metres. A handle has the larger one: where an arm touches the
/// body, the template joins both, and the arm cannot be followed.
constexpr double kPerComponentM2 = 0.003, kPerHandleM2 = 0.05;
constexpr size_t kSampleEvery = 16;  ///< every n-th vertex is tested for visibility
/// Pulses from one to the next in a segment. Farther apart, points of the surface are not known to
/// correspond.
constexpr int64_t kMaxStep = 10;

double area_of(const Mesh& mesh) {
  double area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    area += 0.5 * (mesh.vertices[b] - mesh.vertices[a])
                      .cross(mesh.vertices[c] - mesh.vertices[a])
                      .cast<double>()
                      .norm();
  }
  return area;
}

/// Part of the surface that at least two cameras see; empty without cameras.
std::optional<double> seen_share(const ObservedPulse& observed) {
  if (observed.cameras.cameras.empty()) return std::nullopt;
  std::vector<DepthBuffer> depths;
  draw_depths(observed.surface, observed.cameras.models, depths, Faces::kFront);
  const std::vector<Eigen::Vector3f> normals = vertex_normals(observed.surface);
  const SurfaceSamples samples = every_nth(observed.surface, normals, kSampleEvery);
  const std::vector<uint8_t> seen =
      visible_camera_counts(samples.positions, samples.normals, observed.cameras, depths);
  const auto count = std::ranges::count_if(seen, [](uint8_t cameras) { return cameras >= 2; });
  return static_cast<double>(count) / static_cast<double>(std::max<size_t>(seen.size(), 1));
}

/// The smallest seen share of all pulses with cameras; 1 where none has cameras.
double smallest_share(const std::vector<KeyQuality>& qualities) {
  double smallest = 1;
  for (const KeyQuality& quality : qualities) {
    smallest = std::min(smallest, quality.seen_share.value_or(1));
  }
  return smallest;
}

/// Tracks intervals of pulses and collects the results.
class TakeTracker {
 public:
  TakeTracker(const TakeSource& take, size_t count, const TrackingOptions& options,
              const OnPulse& on_pulse)
      : take_(take), options_(options), on_pulse_(on_pulse) {
    for (size_t i = 0; i < count; ++i) {
      on_pulse(i);
      const auto observed = take.surfaces(i);
      numbers_.push_back(observed->pulse);
      qualities_.push_back(key_quality(*observed));
      is_bound_.push_back(qualities_.back().seen_share ? 1 : 0);
    }
    score_all();
  }

  TrackedMotion run() {
    for (size_t i = 0; i < scores_.size();) {
      size_t end = i + 1;
      while (end < scores_.size() && continues(end, scores_[i].has_value())) ++end;
      if (scores_[i]) {
        track(i, end);
      } else {
        motion_.untracked.push_back({i, end - 1, "no surface"});
      }
      i = end;
    }
    std::ranges::sort(motion_.segments, {}, [](const TrackedSegment& s) { return s.pulses[0]; });
    return std::move(motion_);
  }

 private:
  /// Is pulse `i` in the interval of the pulse before it? `has_surface`: whether that has one.
  bool continues(size_t i, bool has_surface) const {
    if (scores_[i].has_value() != has_surface) return false;
    return !has_surface || numbers_[i] - numbers_[i - 1] <= kMaxStep;
  }

  void score_all() {
    const double share = smallest_share(qualities_);
    scores_.clear();
    for (const KeyQuality& quality : qualities_) scores_.push_back(quality.score(share));
  }

  /// Replaces the upper bound of a pulse by its quality, which needs its images.
  void examine(size_t i) {
    if (is_bound_[i] == 0) return;
    on_pulse_(i);
    qualities_[i] = key_quality(*take_.pulses(i));
    is_bound_[i] = 0;
  }

  /// The pulse with the highest score of `first` to `last` - 1, the first one of several. Images
  /// are read only of pulses whose upper bound is the highest.
  size_t best_key(size_t first, size_t last) {
    for (;;) {
      const auto best = std::max_element(scores_.begin() + static_cast<ptrdiff_t>(first),
                                         scores_.begin() + static_cast<ptrdiff_t>(last));
      const auto key = static_cast<size_t>(best - scores_.begin());
      if (is_bound_[key] == 0) return key;
      examine(key);
      if (!qualities_[key].seen_share) {
        // The score of a pulse without images depends on all pulses with images.
        for (size_t i = 0; i < qualities_.size(); ++i) examine(i);
      }
      score_all();
    }
  }

  /// Tracks the pulses `begin` to `end` - 1.
  void track(size_t begin, size_t end) {
    std::vector<std::pair<size_t, size_t>> open{{begin, end}};
    while (!open.empty()) {
      const auto [first, last] = open.back();
      open.pop_back();
      if (first == last) continue;
      const size_t key = best_key(first, last);
      const PulseSource watched = [this](size_t i) {
        on_pulse_(i);
        return take_.pulses(i);
      };
      TrackedSegment segment =
          track_segment(watched, first, key, last, end, options_, take_.colours);
      const size_t from = key - segment.key;
      const size_t to = from + segment.pulses.size() - (segment.shares_last ? 1 : 0);
      open.push_back({first, from});
      open.push_back({to, last});
      motion_.segments.push_back(std::move(segment));
    }
  }

  const TakeSource& take_;
  const TrackingOptions& options_;
  const OnPulse& on_pulse_;
  std::vector<int64_t> numbers_;               ///< of each pulse
  std::vector<KeyQuality> qualities_;          ///< of each pulse
  std::vector<uint8_t> is_bound_;              ///< 1: the quality is an upper bound
  std::vector<std::optional<double>> scores_;  ///< of each pulse
  TrackedMotion motion_;
};

}  // namespace

std::optional<double> KeyQuality::score(double share_without_cameras) const {
  if (components == 0) return std::nullopt;
  const double seen_m2 = area_m2 * seen_share.value_or(share_without_cameras);
  return seen_m2 - kPerComponentM2 * components - kPerHandleM2 * handles;
}

KeyQuality key_quality(const ObservedPulse& observed) {
  KeyQuality quality;
  const Mesh& mesh = observed.surface;
  if (mesh.triangles.empty()) return quality;
  quality.area_m2 = area_of(mesh);
  quality.seen_share = seen_share(observed);
  quality.components = connected_components(mesh);
  // Euler characteristic of a closed surface: V - E + F = 2 (components - genus), with 2 E = 3 F.
  const auto characteristic =
      static_cast<double>(mesh.vertices.size()) - static_cast<double>(mesh.triangles.size()) / 2;
  quality.handles = std::max(0.0, quality.components - characteristic / 2);
  return quality;
}

codec::MotionSegment motion_segment(const TrackedSegment& segment) {
  codec::MotionSegment result;
  result.pulses = segment.pulses;
  result.key = segment.key;
  result.triangles = segment.surface.triangles;
  for (const auto& positions : segment.positions) {
    result.positions.push_back(vertex_positions(positions));
  }
  result.confidences = segment.confidences;
  return result;
}

TrackedMotion track_motion(const TakeSource& take, size_t count, const TrackingOptions& options,
                           const OnPulse& on_pulse) {
  return TakeTracker(take, count, options, on_pulse).run();
}

}  // namespace v3d::recon
