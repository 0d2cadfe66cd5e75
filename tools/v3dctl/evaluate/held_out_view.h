// A camera that took no part in a reconstruction, as the judge of it.
#pragma once

#include "base/camera_model.h"
#include "base/image.h"
#include "base/mask.h"
#include "base/mesh.h"
#include "daemon/recorded/segmented_log.h"

namespace v3d::ctl {

/// What such a camera photographed, and meshes as it would have photographed them: a drawing goes
/// through the camera's colours and the filters of its sensor, as the photograph did. What the
/// sensor cannot show is then missing in both, and nobody is charged with the false colours of its
/// mosaic.
class HeldOutView {
 public:
  /// `camera` is borrowed.
  HeldOutView(const RigCamera& camera, const SegmentedFrame& frame);

  /// RGB8 of the whole image, in the common colours of the rig.
  const Image& photograph() const { return photograph_; }
  const Mask& mask() const { return mask_; }
  /// The pixels of the photograph that are made of foreground alone: those whose neighbours up to
  /// two pixels away, as far as demosaicing looks, are foreground too.
  const Mask& inside() const { return inside_; }
  Image drawn(const Mesh& mesh) const;

 private:
  Image as_recorded(Image drawing) const;

  const RigCamera& camera_;
  const PixelFormat format_;
  const Mask mask_;
  const Mask inside_;
  const Image photograph_;
};

}  // namespace v3d::ctl
