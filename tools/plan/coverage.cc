#include "plan/coverage.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/core/statistics.h"
#include "plan/placement.h"

namespace v3d::plan {
namespace {

using Eigen::Vector3f;

/// By camera and sample the cosine of the incidence; 0 where the camera does not see the sample.
using Views = std::vector<std::vector<float>>;

Views views_of(const std::vector<CameraModel>& rig, const ActionSamples& action,
               bool own_performer_only) {
  Views views(rig.size());
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t c) {
    views[c] = incidence_from(rig[c].center(), action, own_performer_only);
    for (size_t s = 0; s < views[c].size(); ++s) {
      if (views[c][s] > 0 && !in_image(rig[c], action.samples[s])) views[c][s] = 0;
    }
  });
  return views;
}

int count_at(const Views& views, size_t sample) {
  return static_cast<int>(
      std::ranges::count_if(views, [&](const auto& camera) { return camera[sample] > 0; }));
}

Percentiles percentiles_of(const std::vector<double>& values) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (values.empty()) return {kNone, kNone, kNone};
  return {percentile(values, 0.1), percentile(values, 0.5), percentile(values, 0.9)};
}

double degrees_between(const Vector3f& a, const Vector3f& b) {
  return std::acos(std::clamp(a.dot(b), -1.0F, 1.0F)) * 180 / M_PI;
}

/// Values of single points, which become percentiles.
struct PointValues {
  std::vector<double> mm_per_pixel, error_mm, nearest_deg, widest_deg;

  void add_baselines(const std::vector<Vector3f>& rays) {
    double nearest = 180, widest = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        const double angle = degrees_between(rays[i], rays[j]);
        nearest = std::min(nearest, angle);
        widest = std::max(widest, angle);
      }
    }
    nearest_deg.push_back(nearest);
    widest_deg.push_back(widest);
  }

  void add(const std::vector<CameraModel>& rig, const std::vector<Vector3f>& eyes,
           const Views& views, const ActionSample& sample, size_t index) {
    PointInformation information;
    std::vector<Vector3f> rays;
    double finest = 1e9;
    for (size_t c = 0; c < rig.size(); ++c) {
      const float cosine = views[c][index];
      if (cosine <= 0) continue;
      const Vector3f to_point = sample.point - eyes[c];
      const double pixels_per_metre = rig[c].matrix()(0, 0) / to_point.norm();
      finest = std::min(finest, 1000 / (pixels_per_metre * cosine));
      const auto scale = static_cast<float>(pixels_per_metre / kMatchingErrorPx);
      rays.push_back(to_point.normalized());
      add_camera(information, rays.back(), scale * scale * cosine);
    }
    if (!rays.empty()) mm_per_pixel.push_back(finest);
    if (rays.size() < 2) return;
    error_mm.push_back(1000 * std::sqrt(variance_along(information, sample.normal)));
    add_baselines(rays);
  }
};

void measure_counts(const Views& views, SurfaceCoverage& coverage) {
  const size_t samples = views.empty() ? 0 : views.front().size();
  for (size_t s = 0; s < samples; ++s) {
    coverage.share[static_cast<size_t>(std::min(3, count_at(views, s)))] +=
        1 / static_cast<double>(samples);
  }
  for (const auto& camera : views) {
    const auto seen = std::ranges::count_if(camera, [](float cosine) { return cosine > 0; });
    coverage.camera.push_back(static_cast<double>(seen) / static_cast<double>(samples));
  }
}

void measure_occlusion(const Views& views, const Views& alone, SurfaceCoverage& coverage) {
  int64_t views_alone = 0, views_now = 0, below = 0;
  const size_t samples = views.front().size();
  for (size_t s = 0; s < samples; ++s) {
    const int now = count_at(views, s), without = count_at(alone, s);
    views_now += now;
    views_alone += without;
    below += without >= 2 && now < 2;
  }
  coverage.views_lost =
      1 - static_cast<double>(views_now) / static_cast<double>(std::max<int64_t>(1, views_alone));
  coverage.below_two = static_cast<double>(below) / static_cast<double>(samples);
}

}  // namespace

SurfaceCoverage measure_coverage(const std::vector<CameraModel>& rig, const ActionSamples& action) {
  SurfaceCoverage coverage;
  const Views views = views_of(rig, action, false);
  measure_counts(views, coverage);
  std::vector<Vector3f> eyes;
  for (const CameraModel& camera : rig) eyes.push_back(camera.center().cast<float>());
  PointValues values;
  for (size_t s = 0; s < action.samples.size(); ++s) {
    values.add(rig, eyes, views, action.samples[s], s);
  }
  coverage.mm_per_pixel = percentiles_of(values.mm_per_pixel);
  coverage.error_mm = percentiles_of(values.error_mm);
  coverage.nearest_baseline_deg = percentiles_of(values.nearest_deg);
  coverage.widest_baseline_deg = percentiles_of(values.widest_deg);
  if (action.moments.front().performer.size() > 1) {
    measure_occlusion(views, views_of(rig, action, true), coverage);
  }
  return coverage;
}

}  // namespace v3d::plan
