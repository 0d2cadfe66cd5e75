// Turntable cameras around a box, and contact sheets of their views.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/core/error.h"
#include "base/geometry/rigid_transform.h"
#include "recon/render/renderer.h"

namespace v3d::recon {
namespace {

constexpr double kVerticalFieldOfView = 32 * std::numbers::pi / 180;
constexpr double kRise = 0.22;  // height of the eye over the middle, per metre of distance
constexpr double kMargin = 1.06;
constexpr double kPageShape = 1.6;  // width by height
constexpr int kBorder = 6;
constexpr Rgb8 kBorderColour{12, 13, 15};

/// Smallest distance between eye and box centre at which all corners are in the image.
double min_distance(const Box& bounds, const Eigen::Matrix3d& cam_from_world,
                    const Eigen::Matrix3d& matrix) {
  double distance = 0.1;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d half = 0.5 * kMargin * bounds.size();
    const Eigen::Vector3d corner =
        cam_from_world * Eigen::Vector3d(i & 1 ? half.x() : -half.x(), i & 2 ? half.y() : -half.y(),
                                         i & 4 ? half.z() : -half.z());
    // The principal point is the image centre: |x| f / (z + distance) <= half the image width.
    distance =
        std::max({distance, std::abs(corner.x()) * matrix(0, 0) / (matrix(0, 2) + 0.5) - corner.z(),
                  std::abs(corner.y()) * matrix(1, 1) / (matrix(1, 2) + 0.5) - corner.z()});
  }
  return distance;
}

/// The number of columns with the smallest cost. The cost adds the share of empty places and the
/// logarithmic deviation from kPageShape.
int best_columns(int count, ImageSize view) {
  int best = 1;
  double min_cost = std::numeric_limits<double>::infinity();
  for (int columns = 1; columns <= count; ++columns) {
    const int rows = (count + columns - 1) / columns;
    const double shape = double(columns) * view.width / (double(rows) * view.height);
    const double cost =
        std::abs(std::log(shape / kPageShape)) + double(rows * columns - count) / count;
    if (cost < min_cost) {
      min_cost = cost;
      best = columns;
    }
  }
  return best;
}

}  // namespace

Box bounds_of(const Mesh& mesh) {
  if (mesh.vertices.empty()) {
    return {};
  }
  Eigen::Vector3f low = mesh.vertices[0], high = low;
  for (const Eigen::Vector3f& v : mesh.vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  return {low.cast<double>(), high.cast<double>()};
}

std::vector<CameraModel> turntable_cameras(const Box& bounds, int count, ImageSize size) {
  const double focal = 0.5 * size.height / std::tan(0.5 * kVerticalFieldOfView);
  Eigen::Matrix3d matrix;
  matrix << focal, 0, 0.5 * (size.width - 1), 0, focal, 0.5 * (size.height - 1), 0, 0, 1;
  std::vector<RigidTransform> views;
  double distance = 0;
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * std::numbers::pi * k / count - std::numbers::pi / 2;
    const Eigen::Vector3d towards(std::cos(angle), std::sin(angle), kRise);
    views.push_back(look_at(bounds.center() + towards.normalized(), bounds.center()));
    distance = std::max(distance, min_distance(bounds, views.back().rotation, matrix));
  }
  std::vector<CameraModel> cameras;
  for (RigidTransform& view : views) {
    // The box centre lies on the rotation axis; all views have the same distance from it.
    view.translation = Eigen::Vector3d::UnitZ() * distance - view.rotation * bounds.center();
    cameras.emplace_back(size, matrix, Distortion{}, view);
  }
  return cameras;
}

Image contact_sheet(std::span<const Image> views, int columns) {
  V3D_CHECK(!views.empty());
  const ImageSize view = views[0].size;
  const int count = static_cast<int>(views.size());
  if (columns <= 0) {
    columns = best_columns(count, view);
  }
  const int rows = (count + columns - 1) / columns;
  Image sheet(
      {columns * (view.width + kBorder) + kBorder, rows * (view.height + kBorder) + kBorder},
      PixelFormat::kRGB8);
  for (size_t i = 0; i < sheet.bytes.size(); i += 3) {
    sheet.bytes[i] = kBorderColour.r;
    sheet.bytes[i + 1] = kBorderColour.g;
    sheet.bytes[i + 2] = kBorderColour.b;
  }
  for (int i = 0; i < count; ++i) {
    V3D_CHECK(views[i].size == view && views[i].format == PixelFormat::kRGB8);
    const int x0 = kBorder + i % columns * (view.width + kBorder);
    const int y0 = kBorder + i / columns * (view.height + kBorder);
    for (int y = 0; y < view.height; ++y) {
      std::copy_n(views[i].row(y), 3 * view.width, sheet.row(y0 + y) + 3 * x0);
    }
  }
  return sheet;
}

}  // namespace v3d::recon
