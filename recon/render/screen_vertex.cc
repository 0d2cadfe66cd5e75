#include "recon/render/screen_vertex.h"

// Vector registers of unknown length cannot be members of a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/render/screen_vertex.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <cstring>

#include "recon/hull/voxel_projection.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/hull/voxel_projection_steps.inc"
#include "recon/simd_float.inc"

/// Projects one register of vertices. `world` holds x, y, z of each; `screen` receives a
/// ScreenVertex for each.
template <Lens kLens>
HWY_INLINE void project(const VoxelCamera& camera, const float* world, float* screen) {
  const Floats floats;
  hn::Vec<Floats> x, y, z;
  hn::LoadInterleaved3(floats, world, x, y, z);
  const CameraPoint<Lanes> p =
      HWY_NAMESPACE::camera_point<Lanes>(camera, Lanes(x), Lanes(y), Lanes(z));
  const PixelPoint<Lanes> q = HWY_NAMESPACE::pixel_point<kLens, Lanes>(camera, p);
  const auto in_front = hn::Ge(p.z.v, hn::Set(floats, static_cast<float>(kNearPlaneMetres)));
  const auto in_lens = hn::Le(q.radius2.v, hn::Set(floats, camera.max_radius2));
  const auto inverse = hn::IfThenElseZero(hn::And(in_front, in_lens), reciprocal(p.z).v);
  hn::StoreInterleaved4((q.u - 0.5F).v, (q.v - 0.5F).v, p.z.v, inverse, floats, screen);
}

template <Lens kLens>
void project_all(const VoxelCamera& camera, const float* world, size_t count, float* screen) {
  size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    project<kLens>(camera, world + 3 * i, screen + 4 * i);
  }
  if (i < count) {
    float last[3 * kLanes] = {}, drawn[4 * kLanes];
    std::memcpy(last, world + 3 * i, 3 * (count - i) * sizeof(float));
    project<kLens>(camera, last, drawn);
    std::memcpy(screen + 4 * i, drawn, 4 * (count - i) * sizeof(float));
  }
}

void project_any(const VoxelCamera& camera, const float* world, size_t count, float* screen) {
  switch (camera.lens) {
    case Lens::kPinhole:
      return project_all<Lens::kPinhole>(camera, world, count, screen);
    case Lens::kPolynomial:
      return project_all<Lens::kPolynomial>(camera, world, count, screen);
    default:
      return project_all<Lens::kFull>(camera, world, count, screen);
  }
}

}  // namespace
}  // namespace v3d::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d {

HWY_EXPORT(project_any);

static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
static_assert(sizeof(ScreenVertex) == 4 * sizeof(float));

void project_vertices(const Mesh& mesh, const CameraModel& camera,
                      std::vector<ScreenVertex>& screen) {
  const VoxelCamera lens = camera_of_metres(camera);
  screen.resize(mesh.vertices.size());
  HWY_DYNAMIC_DISPATCH(project_any)
  (lens, reinterpret_cast<const float*>(mesh.vertices.data()), screen.size(),
   reinterpret_cast<float*>(screen.data()));
}

std::vector<ScreenVertex> project_vertices(const Mesh& mesh, const CameraModel& camera) {
  std::vector<ScreenVertex> screen;
  project_vertices(mesh, camera, screen);
  return screen;
}

}  // namespace v3d
#endif
