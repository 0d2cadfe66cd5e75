// View of a held-out camera: its photograph, and renderings of meshes that compare with it.
#pragma once

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"
#include "base/image/mask.h"
#include "daemon/recorded/segmented_log.h"

namespace v3d::ctl {

/// Renderings pass through the colour response of the camera and the Bayer filters of its sensor,
/// like the photograph. So both contain the same false colours of the mosaic, which then do not
/// count as errors.
class HeldOutView {
 public:
  /// `camera` is borrowed.
  HeldOutView(const RigCamera& camera, const SegmentedFrame& frame);

  /// RGB8 of the whole image, in the common colours of the rig.
  const Image& photograph() const { return photograph_; }
  const Mask& mask() const { return mask_; }
  /// Pixels whose neighbours up to two pixels away, the reach of demosaicing, are foreground, too.
  const Mask& inside() const { return inside_; }
  /// Rendering of `mesh` with the colours of its vertices, comparable with photograph().
  Image render(const Mesh& mesh) const;

 private:
  Image as_recorded(Image rendering) const;

  const RigCamera& camera_;
  const PixelFormat format_;
  const Mask mask_;
  const Mask inside_;
  const Image photograph_;
};

/// Images of a HeldOutView for people, cropped to the foreground.
class CroppedHeldOutView {
 public:
  /// Requires a mask with foreground. `camera` is borrowed.
  CroppedHeldOutView(const RigCamera& camera, const SegmentedFrame& frame);
  Image photograph() const;
  Image render(const Mesh& mesh) const;
  /// Absolute difference of both over inside(): black for 0, white for 64 grey values and more.
  Image difference(const Mesh& mesh) const;

 private:
  Image crop(const Image& whole) const;

  const HeldOutView view_;
  const Rect region_;
};

}  // namespace v3d::ctl
