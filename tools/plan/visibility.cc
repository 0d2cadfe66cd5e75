#include "plan/visibility.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace v3d::plan {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kRasterSide = 512;       // pixels
constexpr double kToleranceM = 0.012;  // two pixels of the raster at 3 m
constexpr double kMaxHalfAngle = 1.2;  // radians; for a position close to the performer

/// A square view from `eye` that just contains the box.
CameraModel view_of(const Vector3d& eye, const Box& box) {
  const double radius = 0.5 * box.size().norm();
  const double distance = std::max(1e-3, (box.center() - eye).norm());
  const double half_angle = std::min(kMaxHalfAngle, std::asin(std::min(1.0, radius / distance)));
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = k(1, 1) = 0.5 * kRasterSide / std::tan(half_angle);
  k(0, 2) = k(1, 2) = 0.5 * (kRasterSide - 1);
  return {{kRasterSide, kRasterSide}, k, {}, look_at(eye, box.center())};
}

float incidence(const Vector3f& eye, const SurfaceSample& sample) {
  static const float kMinCosine = static_cast<float>(std::cos(kMaxIncidenceDeg * M_PI / 180));
  const float cosine = (eye - sample.point).normalized().dot(sample.normal);
  return cosine < kMinCosine ? 0 : cosine;
}

/// Clears the incidence of the samples in `range` that surfaces of `list` hide.
void clear_hidden(const CameraModel& view, const sim::DrawList& list,
                  std::span<const SurfaceSample> samples, std::span<float> incidence) {
  std::vector<Vector3f> points;
  points.reserve(samples.size());
  for (const SurfaceSample& sample : samples) points.push_back(sample.point);
  const std::vector<uint8_t> seen = sim::points_seen(view, list, points, kToleranceM);
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) incidence[i] = 0;
  }
}

/// End of the samples from `begin` on that `same` holds for.
template <class Same>
size_t end_of_run(const std::vector<SurfaceSample>& samples, size_t begin, Same same) {
  const auto from = samples.begin() + static_cast<std::ptrdiff_t>(begin);
  return static_cast<size_t>(std::find_if_not(from, samples.end(), same) - samples.begin());
}

}  // namespace

std::vector<float> incidence_from(const Vector3d& eye, const ActionSamples& action,
                                  bool own_performer_only) {
  const std::vector<SurfaceSample>& samples = action.samples;
  std::vector<float> values(samples.size());
  const Vector3f from = eye.cast<float>();
  std::ranges::transform(samples, values.begin(),
                         [&](const SurfaceSample& sample) { return incidence(from, sample); });
  for (size_t begin = 0; begin < samples.size();) {
    const SurfaceSample& first = samples[begin];
    const size_t end = end_of_run(samples, begin, [&](const SurfaceSample& s) {
      return s.moment == first.moment && (!own_performer_only || s.performer == first.performer);
    });
    const ActionMoment& moment = action.moments[first.moment];
    clear_hidden(view_of(eye, moment.extent),
                 own_performer_only ? moment.performer[first.performer] : moment.all,
                 std::span(samples).subspan(begin, end - begin),
                 std::span(values).subspan(begin, end - begin));
    begin = end;
  }
  return values;
}

bool in_image(const CameraModel& camera, const SurfaceSample& sample) {
  const auto pixel = camera.project(sample.point.cast<double>());
  return pixel && camera.inside_image(*pixel);
}

}  // namespace v3d::plan
