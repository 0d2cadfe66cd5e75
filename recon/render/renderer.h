// Renderer and its floor.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/image.h"
#include "base/image/mask.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::recon {

// Software renderer: colour images and silhouettes of a mesh from any viewpoint.

/// A floor with a metric grid and the soft shadow of the mesh.
struct FloorOptions {
  double z = 0;               ///< world height, metres
  double grid_m = 0.5;        ///< between two lines
  double shadow_depth = 0.5;  ///< 0 none, 1 black
};

struct DrawOptions {
  /// Part of the shading that comes from a light at the camera: 0 shows plain colours (to compare
  /// with photographs), 1 full shading. A mesh without colours is grey, with 0.75.
  double head_light = 0;
  Rgb8 top{58, 64, 74};  ///< background: gradient from the top row to the bottom row
  Rgb8 bottom{22, 24, 28};
  /// Background image instead of these colours: RGB8 of camera.size(), borrowed.
  const Image* backdrop = nullptr;
  std::optional<FloorOptions> floor = std::nullopt;
  /// Colours of the surface instead of those of the vertices; its layout is that of the mesh.
  /// Borrowed.
  const TextureAtlas* atlas = nullptr;
};

/// RGB8 image of camera.size(). Vertices are projected through the whole lens model; z-buffer,
/// perspective-correct colours, mean of 2 x 2 samples per pixel. Deterministic: independent of
/// thread count.
Image draw_mesh(const Mesh& mesh, const CameraModel& camera, const DrawOptions& options = {});

/// Bounding box of all vertices; an empty box at the origin without vertices.
Box bounds_of(const Mesh& mesh);

/// `count` upright cameras evenly around the box, a little above its centre, that see all of it.
/// The first is on the side of -y; they continue counter-clockwise seen from above.
std::vector<CameraModel> turntable_cameras(const Box& bounds, int count, ImageSize size);

/// All views in one image, row by row, separated by borders. Requires at least one view, RGB8,
/// equal sizes. `columns` 0 chooses a page-like shape with few empty places.
Image contact_sheet(std::span<const Image> views, int columns = 0);

/// Silhouette of a mesh: the pixels whose centres a triangle covers. One thread.
Mask draw_silhouette(const Mesh& mesh, const CameraModel& camera);

/// One mask per camera, cameras in parallel.
std::vector<Mask> draw_silhouettes(const Mesh& mesh, std::span<const CameraModel> cameras);

// Floor of a rendered scene: a metric grid that fades with distance, and a soft shadow.

/// Intersection of a ray with the floor.
struct FloorHit {
  double distance_m = 0;  ///< along the ray
  float light = 0;        ///< brightness of the lines over the background, 0 to 1
  float shadow = 0;       ///< 0 none, 1 full
};

/// Immutable after construction; any thread.
class Floor {
 public:
  Floor(const Mesh& mesh, const FloorOptions& options);
  /// `eye` in the world, metres; `direction` of unit length. `pixel_rad` is the angle between two
  /// pixels, for anti-aliasing of the lines. Empty when the ray does not meet the floor.
  std::optional<FloorHit> hit(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction,
                              double pixel_rad) const;

 private:
  void draw_shadow(const Mesh& mesh);
  float shadow_at(double x, double y) const;

  FloorOptions options_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double radius_m_ = 1;  ///< beyond about twice this the floor has faded
  Eigen::Vector2d shadow_origin_ = Eigen::Vector2d::Zero();
  double shadow_cell_m_ = 1;
  int shadow_width_ = 0;
  int shadow_height_ = 0;
  std::vector<float> shadow_;
};

}  // namespace v3d::recon
