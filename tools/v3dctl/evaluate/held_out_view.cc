#include "v3dctl/evaluate/held_out_view.h"

#include "base/demosaic.h"
#include "recon/colour_mask.h"
#include "recon/renderer.h"

namespace v3d::ctl {
namespace {

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

}  // namespace

HeldOutView::HeldOutView(const RigCamera& camera, const SegmentedFrame& frame)
    : camera_(camera),
      format_(frame.raw.image.format),
      mask_(frame.mask),
      inside_(inside_of(frame.mask)),
      photograph_(corrected(to_rgb(frame.raw.image.view()), camera.colour)) {}

Image HeldOutView::drawn(const Mesh& mesh) const {
  return as_recorded(draw_mesh(mesh, camera_.model));
}

Image HeldOutView::as_recorded(Image drawing) const {
  if (!is_bayer(format_)) return drawing;
  correct(drawing, camera_.colour.inverse());
  return corrected(to_rgb(mosaic(drawing.view(), format_).view()), camera_.colour);
}

}  // namespace v3d::ctl
