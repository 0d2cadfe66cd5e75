// Where the cameras of a turntable stand, and their pictures side by side.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "recon/renderer.h"

namespace v3d {
namespace {

constexpr double kVerticalFieldOfView = 32 * std::numbers::pi / 180;
constexpr double kRise = 0.22;  // height of the eye over the middle, per metre of distance
constexpr double kMargin = 1.06;
constexpr int kBorder = 6;
constexpr Rgb8 kBorderColour{12, 13, 15};

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
  // A cylinder round the box, seen a little from above, must fit between the image's borders.
  const double radius = std::max(0.01, 0.5 * bounds.size().head<2>().norm());
  const double half_height = std::max(0.01, 0.5 * bounds.size().z()) + kRise * radius;
  const double by_height = half_height * focal / (0.5 * size.height);
  const double by_width = radius * focal / (0.5 * size.width);
  const double distance = kMargin * (std::max(by_height, by_width) + radius);

  std::vector<CameraModel> cameras;
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * std::numbers::pi * k / count - std::numbers::pi / 2;
    const Eigen::Vector3d offset(distance * std::cos(angle), distance * std::sin(angle),
                                 kRise * distance);
    cameras.emplace_back(size, matrix, Distortion{},
                         look_at(bounds.center() + offset, bounds.center()));
  }
  return cameras;
}

Image contact_sheet(std::span<const Image> views, int columns) {
  assert(!views.empty());
  const ImageSize view = views[0].size;
  const int count = static_cast<int>(views.size());
  if (columns <= 0) {
    const double square = std::sqrt(count * 4.0 / 3.0 * view.height / view.width);
    columns = std::clamp(static_cast<int>(std::lround(square)), 1, count);
    columns = (count + (count + columns - 1) / columns - 1) / ((count + columns - 1) / columns);
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
    assert(views[i].size == view && views[i].format == PixelFormat::kRGB8);
    const int x0 = kBorder + i % columns * (view.width + kBorder);
    const int y0 = kBorder + i / columns * (view.height + kBorder);
    for (int y = 0; y < view.height; ++y) {
      std::copy_n(views[i].row(y), 3 * view.width, sheet.row(y0 + y) + 3 * x0);
    }
  }
  return sheet;
}

}  // namespace v3d
