#include "recon/screen.h"

#include "recon/voxel_projection.h"

namespace v3d {
namespace {

ScreenVertex place(const Eigen::Vector3d& world, const CameraModel& camera, int factor) {
  ScreenVertex v;
  const RigidTransform& pose = camera.cam_from_world();
  v.z = static_cast<float>(pose.rotation.row(2).dot(world) + pose.translation.z());
  // The plane itself is in front, or else what clip_to_near_plane() cuts there would be lost.
  if (v.z < static_cast<float>(kNearPlaneMetres)) {
    return v;
  }
  if (const auto pixel = camera.project(world)) {
    v.on_screen = true;
    v.x = static_cast<float>((pixel->x() + 0.5) / factor - 0.5);
    v.y = static_cast<float>((pixel->y() + 0.5) / factor - 0.5);
  }
  return v;
}

struct ClipVertex {
  Eigen::Vector3d world;
  Eigen::Vector3f weights;
  ScreenVertex screen;
  uint32_t index;
};

/// The point of edge p-q on the near plane. The ends are taken in the order of their indices, so
/// that both triangles at the edge find the same point.
ClipVertex cut(const ClipVertex* p, const ClipVertex* q, const CameraModel& camera, int factor) {
  if (q->index < p->index) {
    std::swap(p, q);
  }
  const double s = (kNearPlaneMetres - p->screen.z) / (double{q->screen.z} - p->screen.z);
  ClipVertex v{p->world + s * (q->world - p->world),
               p->weights + static_cast<float>(s) * (q->weights - p->weights),
               {},
               0};
  // Rounding may leave the point a hair behind the plane it was put on.
  const RigidTransform& pose = camera.cam_from_world();
  const double z = pose.rotation.row(2).dot(v.world) + pose.translation.z();
  v.world += (kNearPlaneMetres * (1 + 1e-6) - z) * camera.viewing_direction();
  v.screen = place(v.world, camera, factor);
  return v;
}

template <Lens kLens>
void project_all(const VoxelCamera& lens, const std::vector<Eigen::Vector3f>& world,
                 std::vector<ScreenVertex>& vertices) {
  for (size_t i = 0; i < vertices.size(); ++i) {
    const auto p = camera_point<float>(lens, world[i].x(), world[i].y(), world[i].z());
    const PixelPoint<float> q = pixel_point<kLens>(lens, p);
    vertices[i] = {q.u - 0.5F, q.v - 0.5F, p.z,
                   p.z >= static_cast<float>(kNearPlaneMetres) && q.radius2 <= lens.max_radius2};
  }
}

}  // namespace

std::vector<ScreenVertex> project_vertices(const Mesh& mesh, const CameraModel& camera) {
  // The projection of the volume intersection, for a grid whose voxel indices are metres.
  const VoxelGrid metres{Eigen::Vector3d::Constant(-0.5), 1, {}};
  const VoxelCamera lens(camera, metres);
  std::vector<ScreenVertex> vertices(mesh.vertices.size());
  switch (lens.lens) {
    case Lens::kPinhole:
      project_all<Lens::kPinhole>(lens, mesh.vertices, vertices);
      break;
    case Lens::kPolynomial:
      project_all<Lens::kPolynomial>(lens, mesh.vertices, vertices);
      break;
    case Lens::kFull:
      project_all<Lens::kFull>(lens, mesh.vertices, vertices);
      break;
  }
  return vertices;
}

void reduce(std::vector<ScreenVertex>& vertices, int factor) {
  const float scale = 1.0F / static_cast<float>(factor);
  for (ScreenVertex& v : vertices) {
    v.x = (v.x + 0.5F) * scale - 0.5F;
    v.y = (v.y + 0.5F) * scale - 0.5F;
  }
}

void clip_to_near_plane(const Mesh& mesh, uint32_t t, const CameraModel& camera,
                        const std::vector<ScreenVertex>& vertices, int factor,
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
      polygon[n++] = cut(&p, &q, camera, factor);
    }
  }
  for (int k = 2; k < n; ++k) {
    const std::array<const ClipVertex*, 3> v{&polygon[0], &polygon[k - 1], &polygon[k]};
    if (v[0]->screen.on_screen && v[1]->screen.on_screen && v[2]->screen.on_screen) {
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

}  // namespace v3d
