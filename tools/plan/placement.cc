#include "plan/placement.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/core/error.h"
#include "base/core/text.h"
#include "plan/action_samples.h"

namespace v3d::plan {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxAround = 64;  // positions around the space at each height
constexpr int kMaxRows = 16;    // and along each side of the ceiling

int steps(double length, double step, int most) {
  return std::clamp(static_cast<int>(std::lround(length / step)), 1, most);
}

/// The point of a rectangle with these half sides at `share` (0 to 1) of its outline.
Vector2d on_rectangle(const Vector2d& half, double share) {
  const double sides[4] = {2 * half.x(), 2 * half.y(), 2 * half.x(), 2 * half.y()};
  const Vector2d corners[4] = {
      {-half.x(), -half.y()}, {half.x(), -half.y()}, {half.x(), half.y()}, {-half.x(), half.y()}};
  double along = share * 4 * half.sum();
  int side = 0;
  while (side < 3 && along > sides[side]) along -= sides[side++];
  const Vector2d& from = corners[side];
  return from + along / sides[side] * (corners[(side + 1) % 4] - from);
}

Vector2d on_ellipse(const Vector2d& half, double share) {
  const double angle = 2 * std::numbers::pi * share;
  return {half.x() * std::cos(angle), half.y() * std::sin(angle)};
}

struct Surroundings {
  Vector2d center, half;
  double low, high;  // z, world
  double step;
};

void add_around(const Surroundings& room, Mount mount, std::vector<Vector3d>& positions) {
  const int around = std::max(4, steps(4 * room.half.sum(), room.step, kMaxAround));
  const int rows = std::min(5, steps(room.high - room.low, room.step, kMaxRows) + 1);
  for (int row = 0; row < rows; ++row) {
    const double z = rows == 1 ? room.high : room.low + (room.high - room.low) * row / (rows - 1);
    for (int i = 0; i < around; ++i) {
      const double share = (i + 0.5 * (row % 2)) / around;
      const Vector2d at =
          mount == Mount::kRail ? on_ellipse(room.half, share) : on_rectangle(room.half, share);
      const Vector2d position = room.center + at;
      positions.emplace_back(position.x(), position.y(), z);
    }
  }
}

void add_ceiling(const Surroundings& room, std::vector<Vector3d>& positions) {
  const int columns = steps(2 * room.half.x(), room.step, kMaxRows);
  const int rows = steps(2 * room.half.y(), room.step, kMaxRows);
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      positions.emplace_back(room.center.x() + room.half.x() * ((2 * i + 1.0) / columns - 1),
                             room.center.y() + room.half.y() * ((2 * j + 1.0) / rows - 1),
                             room.high);
    }
  }
}

}  // namespace

std::vector<Vector3d> candidate_positions(const Box& space, const MountOptions& options) {
  const double floor = floor_of(space);
  const Vector2d half = 0.5 * space.size().head<2>() + Vector2d::Constant(options.margin_m);
  const Surroundings room{space.center().head<2>(), half, floor + options.low_m,
                          floor + options.high_m, options.step_m};
  std::vector<Vector3d> positions;
  for (const Mount mount : options.mounts) {
    if (mount == Mount::kCeiling) {
      add_ceiling(room, positions);
    } else {
      add_around(room, mount, positions);
    }
  }
  std::erase_if(positions, [&](const Vector3d& p) { return space.contains(p); });
  return positions;
}

std::vector<Vector3d> candidate_targets(const Box& space) {
  const Vector2d center = space.center().head<2>();
  const Vector2d away = 0.25 * space.size().head<2>();
  std::vector<Vector3d> targets;
  for (const double height : {0.5, 0.9, 1.35}) {
    for (const Vector2d& side :
         {Vector2d(0, 0), Vector2d(1, 0), Vector2d(-1, 0), Vector2d(0, 1), Vector2d(0, -1)}) {
      const Vector2d at = center + side.cwiseProduct(away);
      targets.emplace_back(at.x(), at.y(), floor_of(space) + height);
    }
  }
  return targets;
}

CameraModel ideal_camera(const CandidateLenses& options, double focal_mm, const Vector3d& eye,
                         const Vector3d& target) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = k(1, 1) = focal_mm / options.sensor_width_mm * options.size.width;
  k(0, 2) = 0.5 * (options.size.width - 1);
  k(1, 2) = 0.5 * (options.size.height - 1);
  return {options.size, k, {}, look_at(eye, target)};
}

using Eigen::Vector3f;

void add_camera(PointInformation& point, const Vector3f& to_point, float weight, int sign) {
  point.cameras += sign;
  const float w = sign < 0 ? -weight : weight;
  const float along = w / to_point.squaredNorm();
  point.xx += w - along * to_point.x() * to_point.x();
  point.yy += w - along * to_point.y() * to_point.y();
  point.zz += w - along * to_point.z() * to_point.z();
  point.xy -= along * to_point.x() * to_point.y();
  point.xz -= along * to_point.x() * to_point.z();
  point.yz -= along * to_point.y() * to_point.z();
}

float variance_along(const PointInformation& p, const Vector3f& n) {
  constexpr float kUnknown = std::numeric_limits<float>::infinity();
  if (p.cameras < 2) return kUnknown;
  // n' M^-1 n by the adjugate of the symmetric matrix.
  const float cxx = p.yy * p.zz - p.yz * p.yz;
  const float cxy = p.xz * p.yz - p.xy * p.zz;
  const float cxz = p.xy * p.yz - p.xz * p.yy;
  const float cyy = p.xx * p.zz - p.xz * p.xz;
  const float cyz = p.xy * p.xz - p.xx * p.yz;
  const float czz = p.xx * p.yy - p.xy * p.xy;
  const float determinant = p.xx * cxx + p.xy * cxy + p.xz * cxz;
  const float square = cxx * n.x() * n.x() + cyy * n.y() * n.y() + czz * n.z() * n.z() +
                       2 * (cxy * n.x() * n.y() + cxz * n.x() * n.z() + cyz * n.y() * n.z());
  return determinant > 0 && square > 0 ? square / determinant : kUnknown;
}

float value_of(const PointInformation& point, const Vector3f& normal) {
  constexpr auto kTargetVariance = static_cast<float>(kTargetErrorM * kTargetErrorM);
  if (point.cameras < 2) return point.cameras == 1 ? kValueOfOne : 0.0F;
  return kValueOfTwo + (1 - kValueOfTwo) / (1 + variance_along(point, normal) / kTargetVariance);
}

namespace {

/// A camera with the samples that it sees.
struct Candidate {
  CameraModel camera;
  double focal_mm = 0;
  Vector3f eye = Vector3f::Zero();
  std::vector<uint32_t> samples;
  std::vector<float> weights;  ///< by element of `samples`, see add_camera()
};

class Selection {
 public:
  explicit Selection(const ActionSamples& action)
      : action_(action), points_(action.samples.size()), values_(action.samples.size(), 0.0F) {}

  double gain(const Candidate& candidate) const {
    double gain = 0;
    for (size_t i = 0; i < candidate.samples.size(); ++i) {
      const uint32_t s = candidate.samples[i];
      PointInformation point = points_[s];
      change(point, candidate, i, 1);
      gain += value_of(point, action_.samples[s].normal) - values_[s];
    }
    return gain;
  }

  void apply(const Candidate& candidate, int sign) {
    for (size_t i = 0; i < candidate.samples.size(); ++i) {
      const uint32_t s = candidate.samples[i];
      change(points_[s], candidate, i, sign);
      values_[s] = value_of(points_[s], action_.samples[s].normal);
    }
  }

  double mean_value() const {
    return std::accumulate(values_.begin(), values_.end(), 0.0) /
           static_cast<double>(std::max<size_t>(1, values_.size()));
  }

 private:
  void change(PointInformation& point, const Candidate& candidate, size_t i, int sign) const {
    const Vector3f to_point = action_.samples[candidate.samples[i]].point - candidate.eye;
    add_camera(point, to_point, candidate.weights[i], sign);
  }

  const ActionSamples& action_;
  std::vector<PointInformation> points_;
  std::vector<float> values_;
};

Candidate make_candidate(const CameraModel& camera, double focal_mm, const ActionSamples& action,
                         const std::vector<float>& incidence) {
  Candidate candidate{camera, focal_mm, camera.center().cast<float>(), {}, {}};
  const auto scale = static_cast<float>(camera.matrix()(0, 0) / kMatchingErrorPx);
  for (uint32_t s = 0; s < incidence.size(); ++s) {
    const ActionSample& sample = action.samples[s];
    if (incidence[s] <= 0 || !in_image(camera, sample)) continue;
    candidate.samples.push_back(s);
    candidate.weights.push_back(incidence[s] * scale * scale /
                                (sample.point - candidate.eye).squaredNorm());
  }
  return candidate;
}

/// By position the incidence of all samples.
std::vector<std::vector<float>> incidences_from(const std::vector<Vector3d>& positions,
                                                const ActionSamples& action) {
  std::vector<std::vector<float>> incidences(positions.size());
  tbb::parallel_for(size_t{0}, positions.size(),
                    [&](size_t p) { incidences[p] = incidence_from(positions[p], action); });
  return incidences;
}

/// The share of the samples that at least two positions see.
double attainable_share(const std::vector<std::vector<float>>& incidences, size_t samples) {
  size_t attainable = 0;
  for (size_t s = 0; s < samples; ++s) {
    attainable +=
        std::ranges::count_if(incidences, [&](const auto& from) { return from[s] > 0; }) > 1;
  }
  return static_cast<double>(attainable) / static_cast<double>(std::max<size_t>(1, samples));
}

/// All directions and lenses at all positions.
std::vector<Candidate> make_candidates(const Box& space, const ActionSamples& action,
                                       const PlacementOptions& options,
                                       const std::vector<Vector3d>& positions,
                                       const std::vector<std::vector<float>>& incidences) {
  const std::vector<Vector3d> targets = candidate_targets(space);
  const std::vector<double>& lenses = options.lens.focal_mm;
  const size_t each = targets.size() * lenses.size();
  std::vector<Candidate> candidates(positions.size() * each);
  tbb::parallel_for(size_t{0}, positions.size(), [&](size_t p) {
    for (size_t i = 0; i < each; ++i) {
      const double focal = lenses[i % lenses.size()];
      const CameraModel camera =
          ideal_camera(options.lens, focal, positions[p], targets[i / lenses.size()]);
      candidates[p * each + i] = make_candidate(camera, focal, action, incidences[p]);
    }
  });
  return candidates;
}

bool is_free(const Candidate& candidate, const std::vector<Candidate>& chosen, double separation) {
  return std::none_of(chosen.begin(), chosen.end(), [&](const Candidate& other) {
    return (other.eye - candidate.eye).norm() < static_cast<float>(separation);
  });
}

struct Best {
  const Candidate* candidate = nullptr;
  double gain = 0;
};

/// The first candidate with the largest gain among those that are away from all chosen cameras.
Best best_of(const std::vector<Candidate>& candidates, const Selection& selection,
             const std::vector<Candidate>& chosen, double separation) {
  std::vector<double> gains(candidates.size(), -1);
  tbb::parallel_for(size_t{0}, candidates.size(), [&](size_t i) {
    if (is_free(candidates[i], chosen, separation)) gains[i] = selection.gain(candidates[i]);
  });
  const auto best = std::max_element(gains.begin(), gains.end());
  if (best == gains.end() || *best < 0) return {};
  return {&candidates[static_cast<size_t>(best - gains.begin())], *best};
}

/// Replaces chosen camera `index` by a better candidate. Returns false where there is none.
bool exchange(const std::vector<Candidate>& candidates, Selection& selection,
              std::vector<Candidate>& chosen, size_t index, double separation) {
  constexpr double kMinGain = 1e-3;  // samples
  const Candidate old = chosen[index];
  selection.apply(old, -1);
  chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(index));
  const Best best = best_of(candidates, selection, chosen, separation);
  const bool better = best.candidate && best.gain > selection.gain(old) + kMinGain;
  chosen.insert(chosen.begin() + static_cast<std::ptrdiff_t>(index),
                better ? *best.candidate : old);
  selection.apply(chosen[index], 1);
  return better;
}

std::vector<Candidate> candidates_of(const std::vector<CameraModel>& fixed,
                                     const ActionSamples& action) {
  std::vector<Candidate> cameras;
  for (const CameraModel& camera : fixed) {
    cameras.push_back(make_candidate(camera, 0, action, incidence_from(camera.center(), action)));
  }
  return cameras;
}

/// Adds the best candidate until `count` cameras are chosen.
void choose_greedily(const std::vector<Candidate>& candidates, size_t count, double separation,
                     Selection& selection, std::vector<Candidate>& chosen,
                     const std::function<void()>& progress) {
  while (chosen.size() < count) {
    const Best best = best_of(candidates, selection, chosen, separation);
    if (!best.candidate) {
      throw InputError(
          fmt::format("--cameras {}: the mounts have room for {} at least {} apart; use more "
                      "mounts, or a larger margin",
                      count, chosen.size(), format_length(separation)));
    }
    selection.apply(*best.candidate, 1);
    chosen.push_back(*best.candidate);
    progress();
  }
}

/// Exchanges cameras from index `first` on until no exchange gains, at most `max_passes` times
/// each. Returns the number of exchanges.
int exchange_all(const std::vector<Candidate>& candidates, size_t first, int max_passes,
                 double separation, Selection& selection, std::vector<Candidate>& chosen) {
  int exchanges = 0;
  bool changed = true;
  for (int pass = 0; changed && pass < max_passes; ++pass) {
    changed = false;
    for (size_t i = first; i < chosen.size(); ++i) {
      if (!exchange(candidates, selection, chosen, i, separation)) continue;
      changed = true;
      ++exchanges;
    }
  }
  return exchanges;
}

}  // namespace

CameraPlacement place_cameras(const Box& space, const ActionSamples& action,
                              const std::vector<CameraModel>& fixed,
                              const PlacementOptions& options,
                              const std::function<void()>& progress) {
  Selection selection(action);
  std::vector<Candidate> chosen = candidates_of(fixed, action);
  for (const Candidate& camera : chosen) selection.apply(camera, 1);
  CameraPlacement placement;
  const auto needed = static_cast<size_t>(options.cameras);
  if (chosen.size() < needed) {
    const auto positions = candidate_positions(space, options.mounts);
    const auto incidences = incidences_from(positions, action);
    const auto candidates = make_candidates(space, action, options, positions, incidences);
    placement.attainable = attainable_share(incidences, action.samples.size());
    placement.candidates = static_cast<int>(candidates.size());
    choose_greedily(candidates, needed, options.separation_m, selection, chosen, progress);
    placement.greedy_value = selection.mean_value();
    placement.exchanges = exchange_all(candidates, fixed.size(), options.max_exchanges,
                                       options.separation_m, selection, chosen);
  }
  placement.value = selection.mean_value();
  for (size_t i = fixed.size(); i < chosen.size(); ++i) {
    placement.cameras.push_back(chosen[i].camera);
    placement.focal_mm.push_back(chosen[i].focal_mm);
  }
  return placement;
}

}  // namespace v3d::plan
