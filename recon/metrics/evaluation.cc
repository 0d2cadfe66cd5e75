#include "recon/metrics/evaluation.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/core/statistics.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d::recon {
namespace {

struct Comparison {
  std::vector<double> distance_m;  ///< one per sample
  double mean_angle_deg = 0;
};

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

Comparison compare(const std::vector<SurfaceSample>& samples, const Mesh& other) {
  const NearestTriangle nearest(other);
  const std::vector<Eigen::Vector3f> normals = vertex_normals(other);
  Comparison result;
  result.distance_m.resize(samples.size());
  std::vector<double> angle(samples.size());
  tbb::parallel_for(size_t{0}, samples.size(), [&](size_t i) {
    const auto point = nearest.find(samples[i].position);
    result.distance_m[i] = point->distance;
    angle[i] =
        angle_deg(samples[i].normal, interpolated(other, normals, point->triangle, point->weights));
  });
  for (const double a : angle) {
    result.mean_angle_deg += a / static_cast<double>(angle.size());
  }
  return result;
}

double part_within(const std::vector<double>& distances, double limit_m) {
  const auto count =
      std::count_if(distances.begin(), distances.end(), [&](double d) { return d <= limit_m; });
  return static_cast<double>(count) / static_cast<double>(distances.size());
}

double f_score(const Comparison& accuracy, const Comparison& completeness, double limit_m) {
  const double precision = part_within(accuracy.distance_m, limit_m);
  const double recall = part_within(completeness.distance_m, limit_m);
  return precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
}

constexpr double kStillM = 0.0002;
constexpr double kMovedM = 0.001;

/// Motion and errors at one point of the later reconstruction.
struct PointChange {
  double motion_m = 0;   ///< of the true surface at this point
  double flicker_m = 0;  ///< to the earlier reconstruction
  double error_m = 0;    ///< to the true surface of the later pulse
};

std::vector<PointChange> changes_of(const std::vector<SurfaceSample>& samples,
                                    const MeshAndTruth& before, const MeshAndTruth& now) {
  const NearestTriangle truth(*now.truth), truth_before(*before.truth), earlier(*before.mesh);
  std::vector<PointChange> changes(samples.size());
  tbb::parallel_for(size_t{0}, samples.size(), [&](size_t i) {
    const auto nearest = truth.find(samples[i].position);
    const Eigen::Vector3d position =
        interpolated(*now.truth, now.truth->vertices, nearest->triangle, nearest->weights);
    changes[i] = {truth_before.find(position)->distance,
                  earlier.find(samples[i].position)->distance, nearest->distance};
  });
  return changes;
}

struct Middle {
  double part = 0, p50_mm = 0, p90_mm = 0;
};

template <class Chosen>
Middle middle_of(const std::vector<PointChange>& changes, double PointChange::*figure,
                 const Chosen& chosen) {
  std::vector<double> values;
  for (const PointChange& change : changes) {
    if (chosen(change)) values.push_back(change.*figure);
  }
  if (values.empty()) return {};
  const double part = static_cast<double>(values.size()) / static_cast<double>(changes.size());
  return {part, 1000 * percentile(values, 0.5), 1000 * percentile(values, 0.9)};
}

SurfaceDistance without_surface(bool both) {
  if (both) {
    return {.f_score_2mm = 1,
            .f_score_5mm = 1,
            .f_score_10mm = 1,
            .covered_2mm = 1,
            .covered_5mm = 1,
            .covered_10mm = 1,
            .covered_10mm_by_largest = 1};
  }
  constexpr double kFar = std::numeric_limits<double>::infinity();
  return {.accuracy_p50_mm = kFar,
          .accuracy_p90_mm = kFar,
          .completeness_p50_mm = kFar,
          .completeness_p90_mm = kFar,
          .normal_error_deg = 180};
}

}  // namespace

SurfaceDistance compare_surfaces(const Mesh& reconstructed, const Mesh& truth,
                                 const SurfaceDistanceOptions& options) {
  const std::vector<SurfaceSample> from_result =
      sample_surface(reconstructed, options.samples, options.seed);
  const std::vector<SurfaceSample> from_truth =
      sample_surface(truth, options.samples, options.seed);
  if (from_result.empty() || from_truth.empty()) {
    return without_surface(from_result.empty() && from_truth.empty());
  }
  Comparison accuracy = compare(from_result, truth);
  Comparison completeness = compare(from_truth, reconstructed);
  SurfaceDistance d;
  d.f_score_2mm = f_score(accuracy, completeness, 0.002);
  d.f_score_5mm = f_score(accuracy, completeness, 0.005);
  d.f_score_10mm = f_score(accuracy, completeness, 0.010);
  d.covered_2mm = part_within(completeness.distance_m, 0.002);
  d.covered_5mm = part_within(completeness.distance_m, 0.005);
  d.covered_10mm = part_within(completeness.distance_m, 0.010);
  const Mesh largest = largest_component(reconstructed);
  d.covered_10mm_by_largest = largest.triangles.size() == reconstructed.triangles.size()
                                  ? d.covered_10mm
                                  : part_within(compare(from_truth, largest).distance_m, 0.010);
  d.accuracy_p50_mm = 1000 * percentile(accuracy.distance_m, 0.5);
  d.accuracy_p90_mm = 1000 * percentile(accuracy.distance_m, 0.9);
  d.completeness_p50_mm = 1000 * percentile(completeness.distance_m, 0.5);
  d.completeness_p90_mm = 1000 * percentile(completeness.distance_m, 0.9);
  d.normal_error_deg = accuracy.mean_angle_deg;
  return d;
}

std::optional<SurfaceChange> compare_in_time(const MeshAndTruth& before, const MeshAndTruth& now,
                                             const SurfaceDistanceOptions& options) {
  for (const Mesh* mesh : {before.mesh, before.truth, now.truth}) {
    if (mesh->triangles.empty()) return std::nullopt;
  }
  const auto samples = sample_surface(*now.mesh, options.samples, options.seed);
  if (samples.empty()) return std::nullopt;
  const auto changes = changes_of(samples, before, now);
  const Middle still = middle_of(changes, &PointChange::flicker_m,
                                 [](const PointChange& c) { return c.motion_m <= kStillM; });
  const Middle moving = middle_of(changes, &PointChange::error_m,
                                  [](const PointChange& c) { return c.motion_m >= kMovedM; });
  return SurfaceChange{.still = still.part,
                       .flicker_p50_mm = still.p50_mm,
                       .flicker_p90_mm = still.p90_mm,
                       .moving = moving.part,
                       .moving_p50_mm = moving.p50_mm,
                       .moving_p90_mm = moving.p90_mm};
}

std::vector<double> vertex_distances_mm(const Mesh& mesh, const Mesh& truth) {
  const NearestTriangle nearest(truth);
  std::vector<double> distances(mesh.vertices.size(), std::numeric_limits<double>::infinity());
  tbb::parallel_for(size_t{0}, distances.size(), [&](size_t v) {
    const auto point = nearest.find(mesh.vertices[v].cast<double>());
    if (point) distances[v] = 1000 * point->distance;
  });
  return distances;
}

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

  /// Number of cameras that see the sample, at most kMaxCount.
  size_t count(const SurfaceSample& sample) const {
    size_t seeing = 0;
    for (size_t c = 0; c < cameras_.size() && seeing < kMaxCount; ++c) seeing += sees(c, sample);
    return seeing;
  }

 private:
  bool sees(size_t c, const SurfaceSample& sample) const {
    const CameraModel& camera = cameras_[c];
    const Eigen::Vector3d way = camera.center() - sample.position;
    const double facing = way.dot(sample.normal) / way.norm();
    if (!(facing >= kMinFacing)) return false;
    const auto pixel = camera.project(sample.position);
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
  const auto true_samples = sample_surface(truth, options.samples, options.seed);
  const auto made_samples = sample_surface(reconstructed, options.samples, options.seed);
  if (true_samples.empty()) return report;
  const bool has_mesh = !made_samples.empty();
  const VisibleCameras visible(truth, cameras);
  const NearestTriangle nearest_true(truth), nearest_made(reconstructed);
  const auto normals = vertex_normals(truth);

  std::vector<Judged> judged(true_samples.size());
  tbb::parallel_for(size_t{0}, judged.size(), [&](size_t i) {
    judged[i] = {visible.count(true_samples[i]),
                 has_mesh && nearest_made.find(true_samples[i].position)->distance <= limit_m};
  });
  add_up(judged, &VisibilityFigures::truth, &VisibilityFigures::truth_within, report);
  if (!has_mesh) return report;

  judged.resize(made_samples.size());
  tbb::parallel_for(size_t{0}, judged.size(), [&](size_t i) {
    const auto point = *nearest_true.find(made_samples[i].position);
    const SurfaceSample sample{
        interpolated(truth, truth.vertices, point.triangle, point.weights),
        interpolated(truth, normals, point.triangle, point.weights).normalized()};
    judged[i] = {visible.count(sample), point.distance <= limit_m};
  });
  add_up(judged, &VisibilityFigures::reconstructed, &VisibilityFigures::reconstructed_within,
         report);
  return report;
}

// Similarity of rendered images and photographs: PSNR and SSIM inside a mask.

namespace {

using Plane = std::vector<double>;

Plane luma(ImageView image) {
  Plane plane(static_cast<size_t>(image.size.pixels()));
  for (size_t i = 0; i < plane.size(); ++i) {  // ITU-R BT.601
    plane[i] = 0.299 * image.bytes[3 * i] + 0.587 * image.bytes[3 * i + 1] +
               0.114 * image.bytes[3 * i + 2];
  }
  return plane;
}

Plane product(const Plane& a, const Plane& b) {
  Plane result(a.size());
  std::transform(a.begin(), a.end(), b.begin(), result.begin(), std::multiplies<>());
  return result;
}

constexpr int kRadius = 5;

std::array<double, 2 * kRadius + 1> gaussian() {
  constexpr double kSigma = 1.5;
  std::array<double, 2 * kRadius + 1> window{};
  for (int i = -kRadius; i <= kRadius; ++i) {
    window[i + kRadius] = std::exp(-i * i / (2 * kSigma * kSigma));
  }
  return window;
}

/// One pass along rows (step 1) or columns (step = width): `count` samples from `first`.
void blur_line(const Plane& from, Plane& to, size_t first, size_t step, int count) {
  static const auto window = gaussian();
  for (int i = 0; i < count; ++i) {
    double sum = 0, weight = 0;
    for (int k = std::max(0, i - kRadius); k <= std::min(count - 1, i + kRadius); ++k) {
      sum += window[k - i + kRadius] * from[first + k * step];
      weight += window[k - i + kRadius];
    }
    to[first + i * step] = sum / weight;
  }
}

Plane blurred(const Plane& plane, ImageSize size) {
  Plane rows(plane.size()), both(plane.size());
  const auto width = static_cast<size_t>(size.width);
  for (int y = 0; y < size.height; ++y) {
    blur_line(plane, rows, y * width, 1, size.width);
  }
  for (size_t x = 0; x < width; ++x) {
    blur_line(rows, both, x, width, size.height);
  }
  return both;
}

template <class Visit>
void for_each_pixel(const Mask& where, Visit&& visit) {
  for (int y = 0; y < where.size().height; ++y) {
    for (int x = 0; x < where.size().width; ++x) {
      if (where.get(x, y)) {
        visit(static_cast<size_t>(y) * where.size().width + x);
      }
    }
  }
}

}  // namespace

double psnr_db(ImageView a, ImageView b, const Mask& where) {
  int64_t squares = 0, count = 0;
  for_each_pixel(where, [&](size_t i) {
    for (size_t k = 3 * i; k < 3 * i + 3; ++k) {
      const int difference = a.bytes[k] - b.bytes[k];
      squares += int64_t{difference} * difference;
      ++count;
    }
  });
  if (squares == 0) {
    return std::numeric_limits<double>::infinity();
  }
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(count) / static_cast<double>(squares));
}

double ssim(ImageView a, ImageView b, const Mask& where) {
  constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);
  const Plane x = luma(a), y = luma(b);
  const Plane mean_x = blurred(x, a.size), mean_y = blurred(y, a.size);
  const Plane xx = blurred(product(x, x), a.size), yy = blurred(product(y, y), a.size);
  const Plane xy = blurred(product(x, y), a.size);
  double sum = 0;
  int64_t count = 0;
  for_each_pixel(where, [&](size_t i) {
    const double mx = mean_x[i], my = mean_y[i];
    const double var_x = xx[i] - mx * mx, var_y = yy[i] - my * my, cov = xy[i] - mx * my;
    sum += ((2 * mx * my + kC1) * (2 * cov + kC2)) /
           ((mx * mx + my * my + kC1) * (var_x + var_y + kC2));
    ++count;
  });
  return count > 0 ? sum / static_cast<double>(count) : 1;
}

}  // namespace v3d::recon
