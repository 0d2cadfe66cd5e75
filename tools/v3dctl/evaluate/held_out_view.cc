#include "v3dctl/evaluate/held_out_view.h"

#include <algorithm>
#include <cstdlib>

#include "base/image/demosaic.h"
#include "recon/render/renderer.h"
#include "recon/texture/colour_mask.h"

namespace v3d::ctl {
namespace {

constexpr int kMarginPx = 12;  // around the foreground
constexpr int kMaxGreyDifference = 64;

Mask inside_of(const Mask& mask) {
  Frame frame;
  frame.sensor_size = mask.size();
  frame.roi = {0, 0, mask.size().width, mask.size().height};
  frame.mask = mask;
  const ColourMask colours(frame);
  Mask inside(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (colours.inner(x, y)) inside.set(x, y);
    }
  }
  return inside;
}

Image corrected(Image image, const ColourResponse& response) {
  correct(image, response);
  return image;
}

Rect with_margin(Rect r, ImageSize size) {
  const int x0 = std::max(0, r.x0 - kMarginPx), y0 = std::max(0, r.y0 - kMarginPx);
  return {x0, y0, std::min(size.width, r.x0 + r.width + kMarginPx) - x0,
          std::min(size.height, r.y0 + r.height + kMarginPx) - y0};
}

}  // namespace

HeldOutView::HeldOutView(const RigCamera& camera, const SegmentedFrame& frame)
    : camera_(camera),
      format_(frame.raw.image.format),
      mask_(frame.mask),
      inside_(inside_of(frame.mask)),
      photograph_(corrected(to_rgb(frame.raw.image.view()), camera.colour)) {}

Image HeldOutView::render(const Mesh& mesh) const {
  return as_recorded(draw_mesh(mesh, camera_.model));
}

Image HeldOutView::as_recorded(Image rendering) const {
  if (!is_bayer(format_)) return rendering;
  correct(rendering, camera_.colour.inverse());
  return corrected(to_rgb(mosaic(rendering.view(), format_).view()), camera_.colour);
}

CroppedHeldOutView::CroppedHeldOutView(const RigCamera& camera, const SegmentedFrame& frame)
    : view_(camera, frame), region_(with_margin(frame.mask.bounding_box(), frame.mask.size())) {}

Image CroppedHeldOutView::photograph() const { return crop(view_.photograph()); }

Image CroppedHeldOutView::render(const Mesh& mesh) const { return crop(view_.render(mesh)); }

Image CroppedHeldOutView::difference(const Mesh& mesh) const {
  const Image rendering = view_.render(mesh);
  const Image& photograph = view_.photograph();
  Image difference(rendering.size, PixelFormat::kRGB8);
  for (int y = 0; y < rendering.size.height; ++y) {
    for (int x = 0; x < rendering.size.width; ++x) {
      if (!view_.inside().get(x, y)) continue;
      int max = 0;
      for (int i = 3 * x; i < 3 * x + 3; ++i) {
        max = std::max(max, std::abs(rendering.row(y)[i] - photograph.row(y)[i]));
      }
      const int grey = std::min(255, max * 255 / kMaxGreyDifference);
      std::fill_n(difference.row(y) + 3 * x, 3, static_cast<uint8_t>(grey));
    }
  }
  return crop(difference);
}

Image CroppedHeldOutView::crop(const Image& whole) const {
  Image part({region_.width, region_.height}, PixelFormat::kRGB8);
  for (int y = 0; y < region_.height; ++y) {
    std::copy_n(whole.row(region_.y0 + y) + 3 * region_.x0, 3 * region_.width, part.row(y));
  }
  return part;
}

}  // namespace v3d::ctl
