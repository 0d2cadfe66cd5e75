#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "sim/rendering/scene.h"

namespace v3d::sim {
namespace {

const ImageSize kXga{1024, 768};

bool same_camera(const RigCamera& a, const RigCamera& b) {
  return a.name == b.name && a.model.size() == b.model.size() &&
         a.model.matrix() == b.model.matrix() && a.model.distortion() == b.model.distortion() &&
         a.model.cam_from_world().rotation == b.model.cam_from_world().rotation &&
         a.model.cam_from_world().translation == b.model.cam_from_world().translation;
}

/// Points of the performer's surface, spread over the whole action.
const std::vector<Eigen::Vector3d>& action_points() {
  static const std::vector<Eigen::Vector3d> points = [] {
    std::vector<Eigen::Vector3d> sampled;
    for (double t = 0; t < kActionPeriodSeconds; t += 0.16) {
      const Mesh performer = performer_at(t, 1);
      for (size_t i = 0; i < performer.vertices.size(); i += 7) {
        sampled.push_back(performer.vertices[i].cast<double>());
      }
    }
    return sampled;
  }();
  return points;
}

/// The fraction of action_points() that is inside the image.
double visible_fraction(const RigCamera& camera) {
  int64_t inside = 0;
  for (const Eigen::Vector3d& point : action_points()) {
    const auto pixel = camera.model.project(point);
    inside += pixel && camera.model.inside_image(*pixel);
  }
  return static_cast<double>(inside) / static_cast<double>(action_points().size());
}

TEST(Rig, has_cameras_on_the_wall_at_several_heights) {
  std::set<int> heights;
  for (const RigCamera& camera : make_rig(15, kXga, 1)) {
    const Eigen::Vector3d eye = camera.model.center();
    EXPECT_NEAR(eye.head<2>().norm(), 3, 1e-9);
    EXPECT_GT(eye.z(), 0.3);
    EXPECT_LT(eye.z(), 2.5);
    heights.insert(static_cast<int>(eye.z() * 2));
  }
  EXPECT_GE(heights.size(), 3U);
}

TEST(Rig, sees_the_whole_action_with_all_cameras_except_every_fourth) {
  for (const uint64_t seed : {1U, 2U}) {
    const Rig rig = make_rig(15, kXga, seed);
    int whole = 0, partly = 0;
    for (size_t i = 0; i < rig.size(); ++i) {
      const double fraction = visible_fraction(rig[i]);
      (fraction == 1 ? whole : partly) += 1;
      EXPECT_EQ(fraction < 1, i % 4 == 3) << rig[i].name << " sees " << fraction;
    }
    EXPECT_GE(whole, 4);
    EXPECT_EQ(partly, 3);
  }
}

TEST(Rig, has_the_same_field_of_view_in_every_image_size) {
  for (const ImageSize size : {ImageSize{320, 240}, ImageSize{640, 640}, ImageSize{1920, 1080}}) {
    EXPECT_EQ(visible_fraction(make_rig(5, size, 1)[0]), 1) << size.width << "x" << size.height;
  }
}

TEST(Rig, is_equal_for_equal_seeds_only) {
  const Rig a = make_rig(6, kXga, 5);
  const Rig b = make_rig(6, kXga, 5);
  const Rig c = make_rig(6, kXga, 6);
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(same_camera(a[i], b[i]));
    EXPECT_FALSE(same_camera(a[i], c[i]));
  }
}

TEST(Rig, has_a_different_invertible_lens_in_every_camera) {
  const Rig rig = make_rig(15, kXga, 1);
  std::set<double> k1;
  for (const RigCamera& camera : rig) {
    k1.insert(camera.model.distortion()[0]);
    for (const Eigen::Vector2d& corner : {Eigen::Vector2d(0, 0), Eigen::Vector2d(1023, 0),
                                          Eigen::Vector2d(0, 767), Eigen::Vector2d(1023, 767)}) {
      ASSERT_TRUE(camera.model.ray(corner)) << camera.name;
      const Eigen::Vector3d far = camera.model.center() + 2 * *camera.model.ray(corner);
      ASSERT_TRUE(camera.model.project(far));
      EXPECT_LT((*camera.model.project(far) - corner).norm(), 1e-6);
    }
  }
  EXPECT_EQ(k1.size(), rig.size());
}

TEST(Rig, has_unique_camera_names_for_many_cameras) {
  std::set<std::string> names;
  for (const RigCamera& camera : make_rig(120, {64, 48}, 1)) names.insert(camera.name);
  EXPECT_EQ(names.size(), 120U);
  EXPECT_TRUE(names.contains("cam01"));
}

}  // namespace
}  // namespace v3d::sim
