#include "recon/motion/surface_patches.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

constexpr float kRadius = 0.3F;
const Vector3f kCentre(0, 0, 1);

/// A pattern without repetition, 5 to 10 cm wide.
uint8_t grey_at(const Vector3f& p) {
  const float wave = std::sin(90 * p.x() + 2 * std::sin(31 * p.y())) *
                         std::sin(83 * p.y() + 3 * std::sin(27 * p.z())) +
                     0.7F * std::sin(71 * p.z() + 2 * std::sin(43 * p.x()));
  return static_cast<uint8_t>(std::clamp(128 + 60 * wave, 0.0F, 255.0F));
}

/// A ball whose pattern turned around the vertical axis.
Mesh ball(int rings, float angle) {
  Mesh mesh = shapes::sphere(kCentre, kRadius, rings);
  const Eigen::AngleAxisf back(-angle, Vector3f::UnitZ());
  for (const Vector3f& vertex : mesh.vertices) {
    const uint8_t grey = grey_at(back * (vertex - kCentre));
    mesh.colours.push_back({grey, grey, grey});
  }
  return mesh;
}

/// A ball without a pattern.
Mesh plain_ball() {
  Mesh mesh = shapes::sphere(kCentre, kRadius, 200);
  mesh.colours.assign(mesh.vertices.size(), Rgb8{128, 128, 128});
  return mesh;
}

/// Four cameras around a ball, with what they see of it.
class BallStudio {
 public:
  explicit BallStudio(const Mesh& pictured) {
    for (int i = 0; i < 4; ++i) {
      const double bearing = 0.5 * M_PI * i + 0.3;
      models_.push_back(shapes::camera({2 * std::cos(bearing), 2 * std::sin(bearing), 1.2},
                                       kCentre.cast<double>(), {400, 300}, 500));
    }
    for (const CameraModel& model : models_) {
      frames_.push_back(
          observe("cam", {}, draw_mesh(pictured, model).view(), draw_silhouette(pictured, model)));
    }
    std::vector<DeformCamera> cameras;
    for (size_t i = 0; i < models_.size(); ++i) cameras.push_back({&models_[i], &frames_[i]});
    cameras_ = SurfaceCameras(cameras, pictured, 0.005);
    surface_ = shapes::sphere(kCentre, kRadius, 40);
    normals_ = vertex_normals(surface_);
    draw_depths(surface_, cameras_.models, depths_);
  }
  SeenSurface seen() const { return {&cameras_, &surface_, &normals_, depths_}; }
  const Mesh& surface() const { return surface_; }

 private:
  std::vector<CameraModel> models_;
  std::vector<Frame> frames_;
  SurfaceCameras cameras_;
  Mesh surface_;
  std::vector<Vector3f> normals_;
  std::vector<DepthBuffer> depths_;
};

constexpr double kSpacingM = 0.04;

/// Distances from the matches of learnt patches to the positions where a turn by `angle` moved
/// them.
std::vector<float> errors_after(float angle, float reach_m) {
  const BallStudio before(ball(200, 0)), after(ball(200, angle));
  SurfacePatches patches(before.surface(), kSpacingM);
  const std::vector<Eigen::Matrix3f> still(patches.size(), Eigen::Matrix3f::Identity());
  patches.learn(before.seen(), still);
  std::vector<float> errors;
  const Eigen::AngleAxisf turn(angle, Vector3f::UnitZ());
  for (const PatchMatch& match : patches.match(after.seen(), still, reach_m).found) {
    const Vector3f& rest = before.surface().vertices[match.vertex];
    errors.push_back((match.position - kCentre - turn * (rest - kCentre)).norm());
  }
  return errors;
}

float median_of(std::vector<float> values) {
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  return values[values.size() / 2];
}

TEST(SurfacePatches, are_found_in_place_when_nothing_moves) {
  const std::vector<float> errors = errors_after(0, 0.002F);
  EXPECT_GT(errors.size(), 200U);
  EXPECT_LT(median_of(errors), 0.0003F);
}

TEST(SurfacePatches, are_found_on_a_pattern_that_slides_along_the_surface) {
  // 3 mm at the equator: the alignment alone; and 25 mm: the joint search.
  const std::vector<float> near = errors_after(0.01F, 0.002F);
  EXPECT_GT(near.size(), 200U);
  EXPECT_LT(median_of(near), 0.0008F);
  const std::vector<float> far = errors_after(0.083F, 0.035F);
  EXPECT_GT(far.size(), 120U);
  EXPECT_LT(median_of(far), 0.002F);
}

TEST(SurfacePatches, are_not_found_before_they_are_learnt) {
  const BallStudio before(ball(200, 0));
  SurfacePatches patches(before.surface(), kSpacingM);
  const std::vector<Eigen::Matrix3f> still(patches.size(), Eigen::Matrix3f::Identity());
  const PatchMatches matches = patches.match(before.seen(), still, 0.002F);
  EXPECT_TRUE(matches.found.empty());
  EXPECT_TRUE(matches.missing.empty());
}

TEST(SurfacePatches, are_missing_where_cameras_show_the_surface_without_their_pattern) {
  const BallStudio before(ball(200, 0)), after(plain_ball());
  SurfacePatches patches(before.surface(), kSpacingM);
  const std::vector<Eigen::Matrix3f> still(patches.size(), Eigen::Matrix3f::Identity());
  patches.learn(before.seen(), still);
  const PatchMatches same = patches.match(before.seen(), still, 0.002F);
  EXPECT_LT(same.missing.size(), same.found.size() / 2);
  const PatchMatches plain = patches.match(after.seen(), still, 0.002F);
  EXPECT_LT(plain.found.size(), plain.missing.size() / 20);
  EXPECT_EQ(plain.found.size() + plain.missing.size(), same.found.size() + same.missing.size());
}

TEST(SurfacePatches, are_nearest_to_the_vertices_around_them) {
  const Mesh surface = shapes::sphere(kCentre, kRadius, 40);
  const SurfacePatches patches(surface, kSpacingM);
  for (size_t v = 0; v < surface.vertices.size(); ++v) {
    const uint32_t patch = patches.nearest(v);
    ASSERT_NE(patch, SurfacePatches::kNoPatch);
    EXPECT_EQ(patches.nearest(patch), patch);
    EXPECT_LT((surface.vertices[patch] - surface.vertices[v]).norm(),
              static_cast<float>(kSpacingM));
  }
}

}  // namespace
}  // namespace v3d::recon
