#include "recon/motion/segment_plan.h"

#include <algorithm>

#include "base/core/error.h"
#include "recon/motion/segment_tracker.h"

namespace v3d::recon {
namespace {

/// Penalties of the score, square metres. A handle has the larger one: where an arm touches the
/// body, the template joins both, and the arm cannot be followed.
constexpr double kPerComponentM2 = 0.003, kPerHandleM2 = 0.05;
constexpr size_t kSampleEvery = 16;  ///< every n-th vertex is tested for visibility

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

TakeSurvey survey_pulses(const PulseSource& surfaces, size_t count, const OnPulse& on_pulse) {
  TakeSurvey survey;
  for (size_t i = 0; i < count; ++i) {
    on_pulse(i);
    const auto observed = surfaces(i);
    survey.pulses.push_back(observed->pulse);
    survey.qualities.push_back(key_quality(*observed));
  }
  return survey;
}

TakeIntervals intervals_of(const TakeSurvey& survey) {
  const auto has_surface = [&](size_t i) { return survey.qualities[i].components > 0; };
  const auto continues = [&](size_t i) {
    if (has_surface(i) != has_surface(i - 1)) return false;
    return !has_surface(i) || survey.pulses[i] - survey.pulses[i - 1] <= kMaxPulseStep;
  };
  TakeIntervals intervals;
  const size_t count = survey.pulses.size();
  for (size_t i = 0, end = 0; i < count; i = end) {
    for (end = i + 1; end < count && continues(end);) ++end;
    if (has_surface(i)) {
      intervals.tracked.push_back({i, end, end});
    } else {
      intervals.untracked.push_back({i, end - 1, "no surface"});
    }
  }
  return intervals;
}

std::vector<SegmentRange> rest_of(const SegmentRange& range, const SegmentExtent& extent) {
  V3D_CHECK(range.first <= extent.from && extent.from < extent.to && extent.to <= range.last);
  std::vector<SegmentRange> rest;
  if (range.first < extent.from) rest.push_back({range.first, extent.from, range.limit});
  if (extent.to < range.last) rest.push_back({extent.to, range.last, range.limit});
  return rest;
}

SegmentPlan plan_of(const std::vector<SegmentRange>& intervals, const TrackedExtents& tracked) {
  SegmentPlan plan;
  for (std::vector<SegmentRange> known = intervals; !known.empty();) {
    const SegmentRange range = known.back();
    known.pop_back();
    const auto found = tracked.find(range);
    if (found == tracked.end()) {
      plan.open.push_back(range);
      continue;
    }
    plan.tracked.push_back(range);
    for (const SegmentRange& rest : rest_of(range, found->second)) known.push_back(rest);
  }
  std::ranges::sort(plan.open);
  std::ranges::sort(plan.tracked, {},
                    [&](const SegmentRange& range) { return tracked.at(range).from; });
  return plan;
}

KeyChooser::KeyChooser(const TakeSurvey& survey, const PulseSource& pulses, const OnPulse& on_pulse)
    : survey_(survey), pulses_(pulses), on_pulse_(on_pulse), examined_(survey.pulses.size()) {}

const KeyQuality& KeyChooser::examined(size_t pulse) {
  std::optional<KeyQuality>& quality = examined_[pulse];
  if (!quality) {
    on_pulse_(pulse);
    quality = key_quality(*pulses_(pulse));
  }
  return *quality;
}

size_t KeyChooser::best_key(const SegmentRange& range) {
  std::vector<KeyQuality> qualities = survey_.qualities;
  std::vector<uint8_t> is_bound;
  for (const KeyQuality& quality : qualities) is_bound.push_back(quality.seen_share ? 1 : 0);
  const auto examine = [&](size_t i) {
    if (is_bound[i] == 0) return;
    qualities[i] = examined(i);
    is_bound[i] = 0;
  };
  for (;;) {
    const double share = smallest_share(qualities);
    const auto begin = qualities.begin();
    const auto best = std::max_element(
        begin + static_cast<ptrdiff_t>(range.first), begin + static_cast<ptrdiff_t>(range.last),
        [&](const KeyQuality& a, const KeyQuality& b) { return a.score(share) < b.score(share); });
    const auto key = static_cast<size_t>(best - begin);
    if (is_bound[key] == 0) return key;
    examine(key);
    if (qualities[key].seen_share) continue;
    // The score of a pulse without images depends on all pulses with images.
    for (size_t i = 0; i < qualities.size(); ++i) examine(i);
  }
}

}  // namespace v3d::recon
