#include "recon/metrics/visibility_report.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "recon/metrics/nearest_triangle.h"
#include "recon/metrics/surface_samples.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d {
namespace {

constexpr double kMinFacing = 0.2;
/// Depth tolerance between the true surface and its depth buffer: half a pixel on slanted surfaces,
/// and the distance of flat triangles from a curved surface.
constexpr double kToleranceM = 0.008;
constexpr size_t kMaxCount = std::tuple_size_v<decltype(VisibilityReport::seen_by)> - 1;

class VisibleCameras {
 public:
  VisibleCameras(const Mesh& truth, std::span<const CameraModel> cameras) : cameras_(cameras) {
    draw_depths(truth, cameras, depths_);
  }

  /// Number of cameras that see the place, at most kMaxCount.
  size_t count(const SurfaceSample& place) const {
    size_t seeing = 0;
    for (size_t c = 0; c < cameras_.size() && seeing < kMaxCount; ++c) seeing += sees(c, place);
    return seeing;
  }

 private:
  bool sees(size_t c, const SurfaceSample& place) const {
    const CameraModel& camera = cameras_[c];
    const Eigen::Vector3d way = camera.center() - place.position;
    const double facing = way.dot(place.normal) / way.norm();
    if (!(facing >= kMinFacing)) return false;
    const auto pixel = camera.project(place.position);
    if (!pixel) return false;
    const auto x = static_cast<int>(std::lround(pixel->x()));
    const auto y = static_cast<int>(std::lround(pixel->y()));
    const ImageSize size = depths_[c].size;
    if (!Rect{0, 0, size.width, size.height}.contains(x, y)) return false;
    const double z = -way.dot(camera.viewing_direction());
    const double pixel_m = z / camera.matrix()(0, 0);
    const double slope = std::sqrt(1 - facing * facing) / facing;
    return z <= depths_[c].at(x, y) + kToleranceM + slope * pixel_m;
  }

  std::span<const CameraModel> cameras_;
  std::vector<DepthBuffer> depths_;
};

struct Judged {
  size_t seen_by = 0;
  bool within = false;
};

/// Stores the parts of all samples in `part`, and of the samples within the limit in `within`.
void add_up(const std::vector<Judged>& samples, double VisibilityFigures::*part,
            double VisibilityFigures::*within, VisibilityReport& report) {
  std::array<int64_t, kMaxCount + 1> all{}, correct{};
  for (const Judged& sample : samples) {
    ++all[sample.seen_by];
    correct[sample.seen_by] += sample.within;
  }
  for (size_t n = 0; n <= kMaxCount; ++n) {
    report.seen_by[n].*part = static_cast<double>(all[n]) / static_cast<double>(samples.size());
    report.seen_by[n].*within =
        static_cast<double>(correct[n]) / static_cast<double>(std::max<int64_t>(1, all[n]));
  }
}

}  // namespace

double VisibilityReport::f_score_if_right_from(size_t cameras) const {
  double precision = 0, recall = 0;
  for (size_t n = 0; n < seen_by.size(); ++n) {
    const VisibilityFigures& f = seen_by[n];
    recall += f.truth * (n >= cameras ? 1 : f.truth_within);
    precision += f.reconstructed * (n >= cameras ? 1 : f.reconstructed_within);
  }
  return precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
}

VisibilityReport compare_by_visibility(const Mesh& reconstructed, const Mesh& truth,
                                       std::span<const CameraModel> cameras, double limit_m,
                                       const SurfaceDistanceOptions& options) {
  VisibilityReport report;
  const auto true_places = sample_surface(truth, options.samples, options.seed);
  const auto made_places = sample_surface(reconstructed, options.samples, options.seed);
  if (true_places.empty() || made_places.empty()) return report;
  const VisibleCameras visible(truth, cameras);
  const NearestTriangle nearest_true(truth), nearest_made(reconstructed);
  const auto normals = vertex_normals(truth);

  std::vector<Judged> judged(true_places.size());
  tbb::parallel_for(size_t{0}, judged.size(), [&](size_t i) {
    judged[i] = {visible.count(true_places[i]),
                 nearest_made.find(true_places[i].position)->distance <= limit_m};
  });
  add_up(judged, &VisibilityFigures::truth, &VisibilityFigures::truth_within, report);

  judged.resize(made_places.size());
  tbb::parallel_for(size_t{0}, judged.size(), [&](size_t i) {
    const auto point = *nearest_true.find(made_places[i].position);
    const SurfaceSample place{
        interpolated(truth, truth.vertices, point.triangle, point.weights),
        interpolated(truth, normals, point.triangle, point.weights).normalized()};
    judged[i] = {visible.count(place), point.distance <= limit_m};
  });
  add_up(judged, &VisibilityFigures::reconstructed, &VisibilityFigures::reconstructed_within,
         report);
  return report;
}

}  // namespace v3d
