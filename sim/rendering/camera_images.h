// Renderer of one and of all cameras.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "sim/performer/performer.h"
#include "sim/rendering/noise.h"
#include "sim/rendering/scene.h"

namespace v3d::sim {

// Procedural background of the studio: tiled floor, panelled round wall, ceiling with fluorescent
// tubes.

/// Linear R, G, B (0 to 1) seen from `eye` (world, metres) along `direction` (any length).
Eigen::Vector3f room_colour(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction,
                            uint64_t seed);

/// The background of every pixel of a camera, row-major. Takes about 0.1 s for 1024x768.
std::vector<Eigen::Vector3f> room_image(const CameraModel& camera, uint64_t seed);

// Z-buffer rasteriser: the nearest triangle at each pixel of a camera.

using Triangle = std::array<uint32_t, 3>;

/// A projected vertex. Triangles with a vertex that is not `seen` are not drawn.
struct ScreenPoint {
  float x = 0, y = 0;       ///< pixels, CameraModel's convention
  float inverse_depth = 0;  ///< 1 / z in the camera frame, per metre
  bool seen = false;        ///< in front of the camera and in the valid range of the lens model
};

/// Projects vertices with the full lens model. Edges stay straight, so triangles must be small.
std::vector<ScreenPoint> to_screen(const CameraModel& camera,
                                   std::span<const Eigen::Vector3f> points);

/// The bounding rectangle of all seen points, clipped to the image.
Rect screen_bounds(std::span<const ScreenPoint> points, ImageSize size);

class VisibilityBuffer {
 public:
  static constexpr uint32_t kNothing = 0xFFFFFFFF;

  /// Clears the buffer and sets its area.
  void clear(Rect area);
  /// Draws the front-facing triangles, at pixels whose centres they contain. Triangles are numbered
  /// from `first`.
  void draw(std::span<const ScreenPoint> points, std::span<const Triangle> triangles,
            uint32_t first = 0);

  Rect area() const { return area_; }
  /// The nearest triangle at a pixel of area(), or kNothing.
  uint32_t triangle(int x, int y) const { return triangle_[index(x, y)]; }
  float inverse_depth(int x, int y) const { return inverse_depth_[index(x, y)]; }

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y - area_.y0) * area_.width + (x - area_.x0);
  }

  Rect area_;
  std::vector<float> inverse_depth_;
  std::vector<uint32_t> triangle_;
};

/// Perspective-correct barycentric coordinates of a pixel inside a triangle; their sum is 1.
Eigen::Vector3f weights_at(const ScreenPoint& a, const ScreenPoint& b, const ScreenPoint& c, int x,
                           int y);

// Software renderer of the simulated cameras: full lens model, textures per pixel, ceiling light,
// floor shadow, motion blur of the blade, Bayer mosaic and noise.

/// The light of the studio on a surface with this normal (unit vector): the factor between its
/// texture and the colour that a camera sees.
float light_on(const Eigen::Vector3f& normal);

/// The triangles of one instant, shared by all cameras.
struct DrawList {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector3f> paint;
  std::vector<Triangle> triangles;
  std::vector<Material> materials;  ///< one per triangle
  std::vector<Palette> palettes;    ///< one per triangle
};

/// Adds a part of a performer.
void append(DrawList& list, const Part& part);

/// By point, 1 where `camera` sees it: it is inside the image, and at most `tolerance_m` behind the
/// nearest triangle of `list`. World, metres. Any thread.
std::vector<uint8_t> points_seen(const CameraModel& camera, const DrawList& list,
                                 std::span<const Eigen::Vector3f> points, double tolerance_m);

/// The number of cameras that see each point, as points_seen() decides; `parts`: all surfaces.
/// Cameras in parallel.
std::vector<uint8_t> cameras_that_see(const Rig& rig, const std::vector<Part>& parts,
                                      std::span<const Eigen::Vector3f> points, double tolerance_m);

/// All performers during one exposure. In 1 ms the tip of the blade moves 15 mm (up to 5 px) and
/// the hands less than 1 px, so only blades are drawn at three instants of the exposure.
struct PerformersExposure {
  DrawList body;                  ///< all parts except the blades
  std::array<DrawList, 3> blade;  ///< early, middle and late in the exposure
  /// By performer the shadow casters: ankles and pelvis, or the first joint where a model has none.
  std::vector<std::array<Eigen::Vector2d, 3>> feet;
  uint64_t seed = 0;
};

/// `seconds`: time of the middle of the exposure.
PerformersExposure expose_performers(double seconds, const RenderOptions& options);

/// Renders images of one camera; renders the background once. Threads: one caller at a time.
class CameraRenderer {
 public:
  CameraRenderer(RigCamera camera, RenderOptions options);
  /// `shot` null: the empty studio. Deterministic.
  Image render(const PerformersExposure* shot, uint64_t exposure_number);
  const RigCamera& camera() const { return camera_; }

 private:
  void draw_shadow(const std::array<Eigen::Vector2d, 3>& feet);
  void draw_body(const PerformersExposure& shot);
  void draw_blade(const PerformersExposure& shot);
  void put(int x, int y, const Eigen::Vector3f& light);
  void expose(uint64_t exposure_number, Image& image) const;

  RigCamera camera_;
  RenderOptions options_;
  SensorColour sensor_;
  std::vector<uint16_t> plate_;    ///< samples of the empty studio, grey value times 256
  std::vector<uint16_t> samples_;  ///< of the image being rendered, before noise
  std::vector<int16_t> noise_;     ///< quantiles of the normal distribution, grey value times 256
  VisibilityBuffer depth_;
  VisibilityBuffer blade_depth_;
};

// Batch rendering: the images of all cameras of a rig, in parallel on all cores.

/// Renderers of all cameras of a rig. Threads: one caller at a time.
class BatchRenderer {
 public:
  /// Renders the empty studio for each camera.
  BatchRenderer(const Rig& rig, const RenderOptions& options);

  /// One image per camera, in the order of the rig. `seconds`: time of the middle of the exposure,
  /// or nothing for the empty studio. `exposure_number` seeds the noise.
  std::vector<Image> render_all(std::optional<double> seconds, uint64_t exposure_number);

 private:
  RenderOptions options_;
  std::vector<std::unique_ptr<CameraRenderer>> cameras_;
};

}  // namespace v3d::sim
