// Pictures of a mesh from any viewpoint, for people to look at and for held-out cameras.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/geometry.h"
#include "base/image.h"
#include "base/mask.h"
#include "base/mesh.h"

namespace v3d {

/// A floor with a metric grid and the soft shadow of what stands on it.
struct FloorOptions {
  double z = 0;               ///< world height, metres
  double grid_m = 0.5;        ///< between two lines
  double shadow_depth = 0.5;  ///< 0 none, 1 black
};

struct DrawOptions {
  /// Brightness that comes from a light at the camera: 0 leaves colours as they are (to compare
  /// with photographs), 1 takes all of it from there. A mesh without colours is grey and lit by
  /// 0.75.
  double head_light = 0;
  Rgb8 top{58, 64, 74};  ///< the background runs evenly from the top row to the bottom row
  Rgb8 bottom{22, 24, 28};
  /// Instead of those colours: RGB8 of camera.size(), borrowed.
  const Image* backdrop = nullptr;
  std::optional<FloorOptions> floor = std::nullopt;
};

/// RGB8 image of camera.size(): the whole lens model at the vertices, z-buffer, colour between the
/// vertices correct in perspective, mean of 2 x 2 samples per pixel. Deterministic for any number
/// of threads.
Image draw_mesh(const Mesh& mesh, const CameraModel& camera, const DrawOptions& options = {});

/// Of all vertices; an empty box at the origin without vertices.
Box bounds_of(const Mesh& mesh);

/// `count` upright cameras evenly round the box, a little above its middle, that see all of it. The
/// first stands towards -y; they go counter-clockwise seen from above.
std::vector<CameraModel> turntable_cameras(const Box& bounds, int count, ImageSize size);

/// All views in one picture, row by row, with a border between them. Requires RGB8 views of one
/// size; at least one. `columns` 0: few empty places, and about as wide as a page.
Image contact_sheet(std::span<const Image> views, int columns = 0);

/// Foreground: the pixels of the whole image whose centres any triangle covers. Pure; one thread.
Mask draw_silhouette(const Mesh& mesh, const CameraModel& camera);

/// One mask per camera, cameras in parallel.
std::vector<Mask> draw_silhouettes(const Mesh& mesh, std::span<const CameraModel> cameras);

}  // namespace v3d
