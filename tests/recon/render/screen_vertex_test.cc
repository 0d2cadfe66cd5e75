#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstring>

#include "recon/random_rig.h"
#include "recon/render/rasteriser.h"
#include "recon/shapes.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

const Box kSpace{{-1, -1, -1}, {1, 1, 1}};

Mesh random_points(int count) {
  Mesh mesh;
  for (int i = 0; i < count; ++i) mesh.vertices.push_back(random_point(kSpace).cast<float>());
  return mesh;
}

RC_GTEST_PROP(ScreenVertices, agree_with_the_lens_model_in_double_precision, ()) {
  const CameraModel camera = random_camera(kSpace);
  const Mesh mesh = random_points(uniform_int(1, 40));
  const std::vector<ScreenVertex> screen = project_vertices(mesh, camera);
  RC_ASSERT(screen.size() == mesh.vertices.size());
  for (size_t i = 0; i < screen.size(); ++i) {
    const Eigen::Vector3d world = mesh.vertices[i].cast<double>();
    const double z =
        (camera.cam_from_world().rotation * world + camera.cam_from_world().translation).z();
    RC_ASSERT(std::abs(screen[i].z - z) < 1e-5);
    if (z < 0.2) continue;
    const auto pixel = camera.project(world);
    if (!screen[i].on_screen() || !pixel || !camera.inside_image(*pixel)) continue;
    RC_ASSERT(std::abs(screen[i].x - pixel->x()) < 0.02);
    RC_ASSERT(std::abs(screen[i].y - pixel->y()) < 0.02);
    RC_ASSERT(std::abs(screen[i].inverse_z * z - 1) < 1e-5);
  }
}

RC_GTEST_PROP(ScreenVertices, are_on_screen_in_front_of_the_near_plane_and_inside_the_lens, ()) {
  const CameraModel camera = random_camera(kSpace);
  const Mesh mesh = random_points(uniform_int(1, 40));
  const std::vector<ScreenVertex> screen = project_vertices(mesh, camera);
  for (size_t i = 0; i < screen.size(); ++i) {
    const Eigen::Vector3d p = camera.cam_from_world().rotation * mesh.vertices[i].cast<double>() +
                              camera.cam_from_world().translation;
    const double radius2 = (p.x() * p.x() + p.y() * p.y()) / (p.z() * p.z());
    // Single precision decides at the limits themselves.
    const bool at_limit = std::abs(p.z() - kNearPlaneMetres) < 1e-5 ||
                          std::abs(radius2 - camera.max_radius2()) < 1e-3 * camera.max_radius2();
    if (at_limit) continue;
    RC_ASSERT(screen[i].on_screen() ==
              (p.z() > kNearPlaneMetres && radius2 < camera.max_radius2()));
    RC_ASSERT(screen[i].on_screen() || screen[i].inverse_z == 0);
  }
}

RC_GTEST_PROP(ScreenVertices, have_the_same_bits_with_every_instruction_set, ()) {
  const CameraModel camera = random_camera(kSpace);
  const Mesh mesh = random_points(uniform_int(1, 40));
  const std::vector<ScreenVertex> usual = project_vertices(mesh, camera);
  on_every_instruction_set([&] {
    const std::vector<ScreenVertex> screen = project_vertices(mesh, camera);
    RC_ASSERT(std::memcmp(screen.data(), usual.data(), screen.size() * sizeof(ScreenVertex)) == 0);
  });
}

TEST(ScreenVertices, have_the_length_of_the_mesh_when_their_memory_is_used_again) {
  const CameraModel camera = shapes::camera({3, 0, 0}, {0, 0, 0}, {64, 48}, 60);
  std::vector<ScreenVertex> screen(100);
  project_vertices(shapes::box({-1, -1, -1}, {1, 1, 1}), camera, screen);
  EXPECT_EQ(screen.size(), 8U);
  project_vertices({}, camera, screen);
  EXPECT_TRUE(screen.empty());
}

}  // namespace
}  // namespace v3d::recon
