#include "base/image/frame.h"

#include <algorithm>
#include <utility>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr int down_to_even(int n) { return n & ~1; }
constexpr int up_to_even(int n) { return (n + 1) & ~1; }

/// The box enlarged by `margin`, then to even coordinates (which keep the phase of a Bayer mosaic),
/// clipped to the image.
Rect neighbourhood(Rect box, int margin, ImageSize size) {
  if (box.empty()) {
    return {};
  }
  const int x0 = down_to_even(std::max(0, box.x0 - margin));
  const int y0 = down_to_even(std::max(0, box.y0 - margin));
  const int x1 = std::min(size.width, up_to_even(box.x0 + box.width + margin));
  const int y1 = std::min(size.height, up_to_even(box.y0 + box.height + margin));
  return {x0, y0, x1 - x0, y1 - y0};
}

}  // namespace

Frame observe(const std::string& camera, const FrameLabel& label, ImageView raw, Mask mask,
              int margin) {
  V3D_CHECK(mask.size() == raw.size);
  Frame frame;
  frame.camera = camera;
  frame.label = label;
  frame.sensor_size = raw.size;
  frame.roi = neighbourhood(mask.bounding_box(), margin, raw.size);
  frame.image = crop(raw, frame.roi);
  frame.mask = std::move(mask);
  return frame;
}

}  // namespace v3d
