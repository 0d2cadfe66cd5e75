#include "recon/render/floor.h"

#include <algorithm>
#include <cmath>

#include "base/geometry/box.h"
#include "recon/render/rasteriser.h"

namespace v3d {
namespace {

constexpr double kShadowCellMetres = 0.02;
constexpr int kShadowBlurCells = 4;
constexpr int kShadowMarginCells = 3 * kShadowBlurCells + 1;
constexpr int kMaxShadowCells = 1024;
constexpr double kShadowHeightMetres = 0.6;  // height at which the shadow is reduced to 1/e

/// Running mean over 2 r + 1 cells of one line.
void blur_line(std::vector<float>& map, size_t first, size_t step, int count, int r,
               std::vector<float>& scratch) {
  scratch.resize(count);
  for (int i = 0; i < count; ++i) {
    scratch[i] = map[first + i * step];
  }
  float sum = 0;
  for (int i = -r; i < count; ++i) {
    sum += i + r < count ? scratch[i + r] : 0;
    sum -= i - r - 1 >= 0 ? scratch[i - r - 1] : 0;
    if (i >= 0) {
      map[first + i * step] = sum / static_cast<float>(2 * r + 1);
    }
  }
}

/// Share of the pixel that a grid line covers, 0 to 1. `spread`: metres of floor per pixel.
double line_cover(double coordinate, double grid_m, double spread) {
  const double off = std::abs(coordinate - grid_m * std::round(coordinate / grid_m));
  const double cover = std::clamp(1.0 + 0.006 / spread - off / spread, 0.0, 1.0);
  return cover * std::clamp(1.5 - 3 * spread / grid_m, 0.0, 1.0);  // distant lines would flicker
}

}  // namespace

Floor::Floor(const Mesh& mesh, const FloorOptions& options) : options_(options) {
  const Box bounds = bounds_of(mesh);
  middle_ = bounds.center().head<2>();
  radius_m_ = std::max(1.5, bounds.size().norm());
  draw_shadow(mesh);
}

void Floor::draw_shadow(const Mesh& mesh) {
  const Box bounds = bounds_of(mesh);
  const Eigen::Vector2d cells = bounds.size().head<2>() / kShadowCellMetres;
  if (mesh.triangles.empty() || cells.maxCoeff() > kMaxShadowCells) {
    return;
  }
  shadow_origin_ =
      bounds.min.head<2>() - Eigen::Vector2d::Constant(kShadowMarginCells * kShadowCellMetres);
  shadow_width_ = static_cast<int>(cells.x()) + 2 * kShadowMarginCells + 1;
  shadow_height_ = static_cast<int>(cells.y()) + 2 * kShadowMarginCells + 1;
  shadow_.assign(static_cast<size_t>(shadow_width_) * shadow_height_, 0.0F);

  for (const auto& triangle : mesh.triangles) {
    std::array<ScreenVertex, 3> corner;
    double height = 0;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d p = mesh.vertices[triangle[k]].cast<double>();
      const Eigen::Vector2d at = (p.head<2>() - shadow_origin_) / kShadowCellMetres;
      corner[k].x = static_cast<float>(at.x());
      corner[k].y = static_cast<float>(at.y());
      height += std::max(0.0, p.z() - options_.z) / 3;
    }
    const auto dark = static_cast<float>(std::exp(-height / kShadowHeightMetres));
    for_each_span(corner, Band{shadow_width_, 0, shadow_height_}, [&](int y, int begin, int end) {
      for (int x = begin; x < end; ++x) {
        float& cell = shadow_[static_cast<size_t>(y) * shadow_width_ + x];
        cell = std::max(cell, dark);
      }
    });
  }
  std::vector<float> scratch;
  for (int pass = 0; pass < 3; ++pass) {
    for (int y = 0; y < shadow_height_; ++y) {
      blur_line(shadow_, static_cast<size_t>(y) * shadow_width_, 1, shadow_width_, kShadowBlurCells,
                scratch);
    }
    for (int x = 0; x < shadow_width_; ++x) {
      blur_line(shadow_, x, shadow_width_, shadow_height_, kShadowBlurCells, scratch);
    }
  }
}

float Floor::shadow_at(double x, double y) const {
  const double u = (x - shadow_origin_.x()) / kShadowCellMetres;
  const double v = (y - shadow_origin_.y()) / kShadowCellMetres;
  if (!(u >= 0 && v >= 0 && u < shadow_width_ - 1 && v < shadow_height_ - 1)) {
    return 0;
  }
  const int i = static_cast<int>(u), j = static_cast<int>(v);
  const auto s = static_cast<float>(u - i), t = static_cast<float>(v - j);
  const float* low = shadow_.data() + static_cast<size_t>(j) * shadow_width_ + i;
  const float* high = low + shadow_width_;
  return (low[0] * (1 - s) + low[1] * s) * (1 - t) + (high[0] * (1 - s) + high[1] * s) * t;
}

std::optional<FloorHit> Floor::hit(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction,
                                   double pixel_rad) const {
  if (direction.z() > -1e-4 || eye.z() <= options_.z) {
    return std::nullopt;
  }
  FloorHit hit;
  hit.distance_m = (options_.z - eye.z()) / direction.z();
  const Eigen::Vector3d at = eye + hit.distance_m * direction;
  // Change of x on the floor with the angle of the ray: d (1, 0, -d_x / d_z), which is
  // perpendicular to the ray.
  const auto spread = [&](double d) {
    return hit.distance_m * pixel_rad * std::hypot(1.0, d / direction.z());
  };
  const double lines = std::max(line_cover(at.x(), options_.grid_m, spread(direction.x())),
                                line_cover(at.y(), options_.grid_m, spread(direction.y())));
  const double far = (at.head<2>() - middle_).norm() / radius_m_;
  const double fade = std::exp(-far * far);
  hit.light = static_cast<float>(fade * (0.05 + 0.16 * lines));
  hit.shadow = static_cast<float>(options_.shadow_depth) * shadow_at(at.x(), at.y());
  return hit;
}

}  // namespace v3d
