// Software renderer of the simulated cameras: full lens model, textures per pixel, ceiling light,
// floor shadow, motion blur of the blade, Bayer mosaic and noise.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "sim/performer/performer.h"
#include "sim/rendering/raster.h"
#include "sim/rendering/scene.h"
#include "sim/rendering/sensor_colour.h"

namespace v3d::sim {

/// The triangles of one instant, shared by all cameras.
struct DrawList {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector3f> paint;
  std::vector<Triangle> triangles;
  std::vector<Material> materials;  ///< one per triangle
};

/// The performer during one exposure. In 1 ms the tip of the blade moves 15 mm (up to 5 px) and the
/// hands less than 1 px, so only the blade is drawn at three instants of the exposure.
struct PerformerExposure {
  DrawList body;                        ///< all parts except the blade
  std::array<DrawList, 3> blade;        ///< early, middle and late in the exposure
  std::array<Eigen::Vector2d, 3> feet;  ///< shadow casters: ankles and pelvis
  uint64_t seed = 0;
};

/// `seconds`: time of the middle of the exposure.
PerformerExposure expose_performer(double seconds, uint64_t seed, double exposure_s);

/// Renders images of one camera; renders the background once. Threads: one caller at a time.
class CameraRenderer {
 public:
  CameraRenderer(RigCamera camera, RenderOptions options);
  /// `shot` null: the empty studio. Deterministic.
  Image render(const PerformerExposure* shot, uint64_t exposure_number);
  const RigCamera& camera() const { return camera_; }

 private:
  void draw_shadow(const PerformerExposure& shot);
  void draw_body(const PerformerExposure& shot);
  void draw_blade(const PerformerExposure& shot);
  void put(int x, int y, const Eigen::Vector3f& light);
  void expose(uint64_t exposure_number, Image& image) const;

  RigCamera camera_;
  RenderOptions options_;
  SensorColour sensor_;
  std::vector<uint16_t> plate_;    ///< samples of the empty studio, grey value times 256
  std::vector<uint16_t> samples_;  ///< of the image being rendered, before noise
  std::vector<int16_t> noise_;     ///< quantiles of the normal distribution, grey value times 256
  DepthBuffer depth_;
  DepthBuffer blade_depth_;
};

}  // namespace v3d::sim
