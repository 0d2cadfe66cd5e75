// A camera for the deformation, with its luminance.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/frame.h"
#include "recon/hull/voxel_grid.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d::recon {

// Brightness image for template matching, the input of the photometric force.

/// Brightness (R + 2 G + B) / 4 of the pixels of a frame's roi, with a border that repeats its
/// edge. A Bayer mosaic is filtered with the binomial 3 x 3 kernel, which weights all colours
/// equally at every pixel, so no pattern of the mosaic remains.
///
/// Immutable; any thread.
class Luminance {
 public:
  static constexpr int kBorder = 24;  ///< pixels on each side

  Luminance() = default;
  /// Requires a frame with pixels: its roi is not empty. The picture begins at a multiple of
  /// `alignment` pixels, so that the lattice of a halved one does not depend on the roi: 2 for one
  /// halving, 4 for two.
  explicit Luminance(const Frame& frame, int alignment = 1);
  /// Half the resolution: means of 2 x 2 pixels.
  Luminance halved() const;

  /// Pixels of this image per pixel of the camera: 1, 0.5, ...
  float scale() const { return scale_; }
  /// A position in the image of the camera, (0.5, 0.5) in the centre of its first pixel, times
  /// scale(), minus (first_u(), first_v()), is the position in this lattice of pixel centres.
  float first_u() const { return first_u_; }
  float first_v() const { return first_v_; }
  int width() const { return width_; }
  int height() const { return height_; }
  /// Row by row: the brightness at (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1), the first in the
  /// lowest byte, so that one load is enough to interpolate. The last column and row repeat the
  /// ones before.
  const uint32_t* quads() const { return quads_.data(); }

 private:
  void put_together(const std::vector<uint8_t>& inner, int width, int height);

  float scale_ = 1;
  float first_u_ = 0, first_v_ = 0;
  int width_ = 0, height_ = 0;
  std::vector<uint32_t> quads_;
};

// One camera as the deformation uses it: projection, visibility test, and brightness at two
// resolutions.

/// A frame and its camera, both borrowed. Requires frame->sensor_size == model->size() and a mask.
struct DeformCamera {
  const CameraModel* model = nullptr;
  const Frame* frame = nullptr;
};

/// Immutable; any thread.
class SurfaceCamera {
 public:
  static constexpr int kLevels = 2;  ///< of the image: full and half resolution

  struct Seen {
    Eigen::Vector2f pixel{0, 0};  ///< (0.5, 0.5) is the middle of the first pixel
    float z = 0;                  ///< metres along the optical axis
  };

  /// Requires that the frame has pixels. `halvings`: how often its image is halved to become
  /// picture(0); see redundant_halvings().
  explicit SurfaceCamera(const DeformCamera& camera, int halvings = 0);

  const Eigen::Vector3f& center() const { return center_; }
  const VoxelCamera& lens() const { return lens_; }  ///< for positions in metres
  const Mask& silhouette() const { return *frame_->mask; }
  const Luminance& picture(int level) const { return pictures_[level]; }
  /// Width of a pixel of picture(0) in pixels of the camera.
  float coarseness() const { return 1 / pictures_[0].scale(); }
  /// Width of a pixel in metres at a distance of 1 m.
  float pixel_m_per_m() const { return 1 / lens_.pixel_from_lens[0][0]; }

  /// Projection of `position` (world, metres), also outside the image. Empty before the near plane
  /// and outside the lens model.
  std::optional<Seen> project(const Eigen::Vector3f& position) const;
  /// True when the pixel exists and is foreground.
  bool in_silhouette(const Eigen::Vector2f& pixel) const {
    const bool exists =
        pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < lens_.width && pixel.y() < lens_.height;
    return exists && frame_->mask->get(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
  }
  /// Visibility test: `seen` is foreground, and at most `tolerance_m` behind the surface in
  /// `depth`, the depth buffer of the mesh.
  bool sees(const Seen& seen, const DepthBuffer& depth, float tolerance_m) const;

 private:
  const Frame* frame_;
  VoxelCamera lens_;
  Eigen::Vector3f center_;
  std::array<Luminance, kLevels> pictures_;
};

/// The cameras of a frame set that have an image. Immutable; any thread.
struct SurfaceCameras {
  SurfaceCameras() = default;
  /// Cameras without pixels are left out; the order is kept. The distance of `mesh` (voxels of
  /// `voxel_m` metres) decides the image resolution. Works in the caller's TBB arena.
  SurfaceCameras(std::span<const DeformCamera> cameras, const Mesh& mesh, double voxel_m);

  std::vector<SurfaceCamera> cameras;
  std::vector<CameraModel> models;  ///< of each
};

/// How often the image can be halved until its pixels are as wide as a quarter of a voxel at the
/// distance of `position` (world, metres). Windows are sampled by the voxel, so finer pixels would
/// be skipped and add noise.
int redundant_halvings(const CameraModel& camera, const Eigen::Vector3f& position, double voxel_m);

/// Mean of the vertices; (0, 0, 0) for an empty mesh.
Eigen::Vector3f vertex_centroid(const Mesh& mesh);

}  // namespace v3d::recon
