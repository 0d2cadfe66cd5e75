// A camera as the deformation of a surface uses it: where it sees a place, whether the mesh hides
// it, and the picture at several resolutions.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "recon/hull/voxel_projection.h"
#include "recon/visibility/depth_buffer.h"
#include "recon/visibility/luminance.h"

namespace v3d {

/// A frame and what took it, both borrowed. Requires frame->sensor_size == model->size() and a
/// mask.
struct DeformCamera {
  const CameraModel* model = nullptr;
  const Frame* frame = nullptr;
};

/// Immutable; safe to use from any thread.
class SurfaceCamera {
 public:
  static constexpr int kLevels = 2;  ///< of the picture: whole and half resolution

  struct Seen {
    Eigen::Vector2f pixel{0, 0};  ///< (0.5, 0.5) is the middle of the first pixel
    float z = 0;                  ///< metres along the optical axis
  };

  /// Requires that the frame has pixels. `halvings`: how often its picture is halved before it is
  /// picture(0); see redundant_halvings().
  explicit SurfaceCamera(const DeformCamera& camera, int halvings = 0);

  const Eigen::Vector3f& center() const { return center_; }
  const VoxelCamera& lens() const { return lens_; }  ///< for places in metres
  const Mask& silhouette() const { return *frame_->mask; }
  const Luminance& picture(int level) const { return pictures_[level]; }
  /// Pixels of the camera along a side of one of picture(0).
  float coarseness() const { return 1 / pictures_[0].scale(); }
  /// Metres that one pixel covers at a distance of 1 m.
  float pixel_m_per_m() const { return 1 / lens_.pixel_from_lens[0][0]; }

  /// Where a place (world, metres) appears, also outside the image.
  std::optional<Seen> project(const Eigen::Vector3f& place) const;
  /// True when the pixel exists and is foreground.
  bool in_silhouette(const Eigen::Vector2f& pixel) const {
    const bool exists =
        pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < lens_.width && pixel.y() < lens_.height;
    return exists && frame_->mask->get(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
  }
  /// Step 1 of the deformation: `seen` is foreground, and no more than `tolerance_m` behind what
  /// `depth` shows of the mesh.
  bool sees(const Seen& seen, const DepthBuffer& depth, float tolerance_m) const;

 private:
  const Frame* frame_;
  VoxelCamera lens_;
  Eigen::Vector3f center_;
  std::array<Luminance, kLevels> pictures_;
};

/// The cameras of a frame set that have pixels, before a surface. Immutable; any thread.
struct SurfaceCameras {
  SurfaceCameras() = default;
  /// In the same order. Where `mesh` is says how finely they can see it. Works in the caller's TBB
  /// arena.
  SurfaceCameras(std::span<const DeformCamera> cameras, const Mesh& mesh, double voxel_m);

  std::vector<SurfaceCamera> cameras;
  std::vector<CameraModel> models;  ///< of each
};

/// How often a picture can be halved until its pixels are as wide as a quarter of a voxel, or
/// wider, at the distance of `place` (world). Windows are sampled by the voxel, and outlines are
/// looked for around them: pixels that are finer would be passed over, each with its noise.
int redundant_halvings(const CameraModel& camera, const Eigen::Vector3f& place, double voxel_m);

/// The mean of the vertices, for redundant_halvings(); (0, 0, 0) of an empty mesh.
Eigen::Vector3f vertex_centroid(const Mesh& mesh);

}  // namespace v3d
