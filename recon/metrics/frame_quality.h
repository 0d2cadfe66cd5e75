// How well the surface of one pulse explains the silhouettes that it was made of: one score per
// frame, cheap enough to go with every live mesh.
#pragma once

#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/geometry.h"
#include "base/mesh.h"
#include "recon/visibility/surface_points.h"

namespace v3d {

/// Measured on cells of 8 x 8 pixels. A cell is reached when the camera sees a vertex of the
/// surface in it, or, where vertices are too far apart for that, a triangle touches it with its
/// bounding box. What of a silhouette lies in cells that are reached is explained; a cell that is
/// reached and holds no pixel of the silhouette (nor does one beside it) is too much. Silhouettes
/// count as far as they lie in the view of the space.
struct FrameQuality {
  /// Explained pixels, as part of the silhouette's and of those of the cells that are too much; the
  /// mean over the cameras that see anything. 0 to 1; 1 where there is nothing to see.
  double silhouette_iou = 1;
  /// Explained pixels as part of the silhouettes', over all cameras together. 0 to 1.
  double coverage = 1;
  int cameras = 0;  ///< that took part
};

/// Immutable; any thread.
class QualityMeter {
 public:
  /// `edge_m`: the longest edge of the surfaces. Works in the caller's TBB arena, for some 10 ms a
  /// camera.
  QualityMeter(const Rig& rig, const Box& bounds, double edge_m);

  /// frames: one per camera of the rig, with a mask of its image size; null where a camera takes no
  /// part. Cameras in parallel; the result does not depend on the number of threads.
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

}  // namespace v3d
