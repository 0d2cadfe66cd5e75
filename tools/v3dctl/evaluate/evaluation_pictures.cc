#include "v3dctl/evaluate/evaluation_pictures.h"

#include <algorithm>
#include <cmath>

#include "recon/evaluation.h"
#include "recon/renderer.h"

namespace v3d::ctl {
namespace {

constexpr int kSides = 4;
constexpr ImageSize kView{300, 460};
constexpr double kLight = 0.55;  ///< of it from the camera, so that the shape shows
constexpr int kRoom = 12;        ///< pixels round a person
constexpr int kWorstGrey = 64;

Rgb8 error_colour(double mm) {
  constexpr size_t kSteps = std::size(kErrorColours) - 1;
  const double at = std::clamp(mm / kWorstErrorMm, 0.0, 1.0) * kSteps;
  const auto step = std::min(static_cast<size_t>(at), kSteps - 1);
  const double part = at - static_cast<double>(step);
  const Rgb8 &from = kErrorColours[step], &to = kErrorColours[step + 1];
  const auto mix = [&](uint8_t a, uint8_t b) {
    return static_cast<uint8_t>(std::lround(a + part * (b - a)));
  };
  return {mix(from.r, to.r), mix(from.g, to.g), mix(from.b, to.b)};
}

Rect with_room(Rect r, ImageSize size) {
  const int x0 = std::max(0, r.x0 - kRoom), y0 = std::max(0, r.y0 - kRoom);
  return {x0, y0, std::min(size.width, r.x0 + r.width + kRoom) - x0,
          std::min(size.height, r.y0 + r.height + kRoom) - y0};
}

}  // namespace

std::vector<Image> painted_errors(const Mesh& mesh, const Mesh& truth) {
  Mesh painted = mesh;
  painted.colours.clear();
  for (const double mm : vertex_distances_mm(mesh, truth)) {
    painted.colours.push_back(error_colour(mm));
  }
  std::vector<Image> views;
  for (const CameraModel& camera : turntable_cameras(bounds_of(truth), kSides, kView)) {
    views.push_back(draw_mesh(painted, camera, {.head_light = kLight}));
  }
  return views;
}

HeldOutPicture::HeldOutPicture(const RigCamera& camera, const SegmentedFrame& frame)
    : view_(camera, frame), place_(with_room(frame.mask.bounding_box(), frame.mask.size())) {}

Image HeldOutPicture::photograph() const { return cut(view_.photograph()); }

Image HeldOutPicture::rendering(const Mesh& mesh) const { return cut(view_.drawn(mesh)); }

Image HeldOutPicture::difference(const Mesh& mesh) const {
  const Image drawn = view_.drawn(mesh);
  const Image& photograph = view_.photograph();
  Image apart(drawn.size, PixelFormat::kRGB8);
  for (int y = 0; y < drawn.size.height; ++y) {
    for (int x = 0; x < drawn.size.width; ++x) {
      if (!view_.inside().get(x, y)) continue;
      int most = 0;
      for (int i = 3 * x; i < 3 * x + 3; ++i) {
        most = std::max(most, std::abs(drawn.row(y)[i] - photograph.row(y)[i]));
      }
      const int grey = std::min(255, most * 255 / kWorstGrey);
      std::fill_n(apart.row(y) + 3 * x, 3, static_cast<uint8_t>(grey));
    }
  }
  return cut(apart);
}

Image HeldOutPicture::cut(const Image& whole) const {
  Image part({place_.width, place_.height}, PixelFormat::kRGB8);
  for (int y = 0; y < place_.height; ++y) {
    std::copy_n(whole.row(place_.y0 + y) + 3 * place_.x0, 3 * place_.width, part.row(y));
  }
  return part;
}

}  // namespace v3d::ctl
