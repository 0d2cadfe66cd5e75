#include "recon/render/rasteriser.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/render/rasteriser.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <cstring>

#include "recon/hull/voxel_grid.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
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
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

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

namespace {

ScreenVertex place(const Eigen::Vector3d& world, const CameraModel& camera) {
  ScreenVertex v;
  const RigidTransform& pose = camera.cam_from_world();
  v.z = static_cast<float>(pose.rotation.row(2).dot(world) + pose.translation.z());
  // Points on the near plane count as in front; otherwise the points computed by
  // clip_to_near_plane() would be lost.
  if (v.z < static_cast<float>(kNearPlaneMetres)) {
    return v;
  }
  if (const auto pixel = camera.project(world)) {
    v.x = static_cast<float>(pixel->x());
    v.y = static_cast<float>(pixel->y());
    v.inverse_z = 1.0F / v.z;
  }
  return v;
}

struct ClipVertex {
  Eigen::Vector3d world;
  Eigen::Vector3f weights;
  ScreenVertex screen;
  uint32_t index;
};

/// The intersection of edge p-q with the near plane. The ends are ordered by index, so that both
/// triangles at the edge compute the same point.
ClipVertex cut(const ClipVertex* p, const ClipVertex* q, const CameraModel& camera) {
  if (q->index < p->index) {
    std::swap(p, q);
  }
  const double s = (kNearPlaneMetres - p->screen.z) / (double{q->screen.z} - p->screen.z);
  ClipVertex v{p->world + s * (q->world - p->world),
               p->weights + static_cast<float>(s) * (q->weights - p->weights),
               {},
               0};
  // Move the point slightly in front of the plane, because rounding may put it behind.
  const RigidTransform& pose = camera.cam_from_world();
  const double z = pose.rotation.row(2).dot(v.world) + pose.translation.z();
  v.world += (kNearPlaneMetres * (1 + 1e-6) - z) * camera.viewing_direction();
  v.screen = place(v.world, camera);
  return v;
}

}  // namespace

void clip_to_near_plane(const Mesh& mesh, uint32_t t, const CameraModel& camera,
                        const std::vector<ScreenVertex>& vertices,
                        std::vector<ScreenTriangle>& pieces) {
  pieces.clear();
  std::array<ClipVertex, 3> corner;
  for (int k = 0; k < 3; ++k) {
    const uint32_t i = mesh.triangles[t][k];
    corner[k] = {mesh.vertices[i].cast<double>(), Eigen::Vector3f::Unit(k), vertices[i], i};
  }
  const auto in_front = [](const ClipVertex& v) {
    return v.screen.z >= static_cast<float>(kNearPlaneMetres);
  };
  std::array<ClipVertex, 4> polygon;  // Sutherland-Hodgman against one plane
  int n = 0;
  for (int k = 0; k < 3; ++k) {
    const ClipVertex& p = corner[k];
    const ClipVertex& q = corner[(k + 1) % 3];
    if (in_front(p)) {
      polygon[n++] = p;
    }
    if (in_front(p) != in_front(q)) {
      polygon[n++] = cut(&p, &q, camera);
    }
  }
  for (int k = 2; k < n; ++k) {
    const std::array<const ClipVertex*, 3> v{&polygon[0], &polygon[k - 1], &polygon[k]};
    if (v[0]->screen.on_screen() && v[1]->screen.on_screen() && v[2]->screen.on_screen()) {
      pieces.push_back({{v[0]->screen, v[1]->screen, v[2]->screen},
                        {v[0]->weights, v[1]->weights, v[2]->weights}});
    }
  }
}

ScreenPlane::ScreenPlane(const std::array<ScreenVertex, 3>& corner,
                         const std::array<double, 3>& value) {
  const double x1 = double{corner[1].x} - corner[0].x, y1 = double{corner[1].y} - corner[0].y;
  const double x2 = double{corner[2].x} - corner[0].x, y2 = double{corner[2].y} - corner[0].y;
  const double area = x1 * y2 - x2 * y1;
  if (area != 0) {
    const double v1 = value[1] - value[0], v2 = value[2] - value[0];
    dx = (v1 * y2 - v2 * y1) / area;
    dy = (v2 * x1 - v1 * x2) / area;
  }
  at_origin = value[0] - dx * corner[0].x - dy * corner[0].y;
}

}  // namespace v3d::recon
#endif
