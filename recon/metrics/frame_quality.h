// Quality of a reconstruction without ground truth: how well the surface of a pulse explains its
// silhouettes. Fast enough for every live mesh.
#pragma once

#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/frame.h"
#include "recon/visibility/point_depth_buffer.h"

namespace v3d::recon {

/// Measured on cells of 8 x 8 pixels. A cell is reached when a vertex of the surface projects into
/// it or, where vertices are too far apart, the bounding box of a projected triangle touches it.
/// Foreground in reached cells is explained. A reached cell is excess when neither it nor a
/// neighbour contains foreground. Only foreground inside bounds_mask() counts.
struct FrameQuality {
  /// Explained pixels as part of foreground and excess pixels, mean over the cameras that have any.
  /// 0 to 1; 1 when no camera has any.
  double silhouette_iou = 1;
  /// Explained pixels as part of the foreground, over all cameras together. 0 to 1.
  double coverage = 1;
  int cameras = 0;  ///< that took part
};

/// Immutable; any thread.
class QualityMeter {
 public:
  /// `bounds` (world, metres) is the reconstructed space, `edge_m` the longest edge of the
  /// surfaces. Works in the caller's TBB arena, about 10 ms per camera.
  QualityMeter(const Rig& rig, const Box& bounds, double edge_m);

  /// `frames` has one entry per camera of the rig, with a mask of its image size; null where a
  /// camera takes no part. Cameras in parallel; independent of thread count.
  FrameQuality measure(const Mesh& mesh, std::span<const Frame* const> frames) const;

 private:
  struct Count {
    int64_t pixels = 0;     ///< of the silhouette
    int64_t explained = 0;  ///< of these
    int64_t excess = 0;     ///< pixels beside them
  };
  Count count(const Mesh& mesh, std::span<const PointArrays, 2> halves, const Mask& silhouette,
              size_t camera) const;

  const std::vector<CameraModel> models_;
  const double edge_m_;
  std::vector<Mask> views_;
};

}  // namespace v3d::recon
