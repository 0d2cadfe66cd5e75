// What the cameras see: a software rasteriser with the whole lens model, textures evaluated per
// pixel, ceiling light, a shadow on the floor, motion blur of the blade, filter mosaic and noise.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "sim/performer.h"
#include "sim/raster.h"
#include "sim/scene.h"
#include "sim/sensor_colour.h"

namespace v3d::sim {

/// Surfaces to draw, flattened: what all cameras share of one instant.
struct DrawList {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector3f> paint;
  std::vector<Triangle> triangles;
  std::vector<Material> materials;  ///< one per triangle
};

/// The performer at one exposure. Within 1/1000 s the blade's tip moves 15 mm, up to 5 pixels; the
/// hands less than 1 pixel. So the blade alone is drawn at three instants of the exposure.
struct PerformerShot {
  DrawList body;                        ///< all parts but the blade
  std::array<DrawList, 3> blade;        ///< early, middle and late in the exposure
  std::array<Eigen::Vector2d, 3> feet;  ///< what throws the shadow: ankles, and the pelvis
  uint64_t seed = 0;
};

/// `seconds`: the middle of the exposure.
PerformerShot shoot(double seconds, uint64_t seed, double exposure_s);

/// One camera with its empty room drawn once. One thread; copies nothing but the finished image.
class CameraRenderer {
 public:
  CameraRenderer(RigCamera camera, RenderOptions options);
  /// `shot` null: the empty room. The same arguments give the same bytes.
  Image render(const PerformerShot* shot, uint64_t exposure_number);
  const RigCamera& camera() const { return camera_; }

 private:
  void draw_shadow(const PerformerShot& shot);
  void draw_body(const PerformerShot& shot);
  void draw_blade(const PerformerShot& shot);
  void put(int x, int y, const Eigen::Vector3f& light);
  void expose(uint64_t exposure_number, Image& image) const;

  RigCamera camera_;
  RenderOptions options_;
  SensorColour sensor_;
  std::vector<uint16_t> plate_;    ///< samples of the empty room, grey value times 256
  std::vector<uint16_t> samples_;  ///< of the image being rendered, before noise
  std::vector<int16_t> noise_;     ///< quantiles of the normal distribution, grey value times 256
  DepthBuffer depth_;
  DepthBuffer blade_depth_;
};

}  // namespace v3d::sim
