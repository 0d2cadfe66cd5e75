#include "v3dctl/view_colours.h"

#include <algorithm>

namespace v3d::ctl {
namespace {

/// The mean length of an edge, metres: the voxel that the mesh was made of, near enough.
double edge_length(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    sum += (mesh.vertices[a] - mesh.vertices[b]).norm();
  }
  return sum / static_cast<double>(std::max<size_t>(1, mesh.triangles.size()));
}

}  // namespace

ViewColours::ViewColours(const std::filesystem::path& take, const CompactFrame& frame) {
  TakeFrames frames(take, frame.cameras);
  rig_ = frames.rig();
  set_ = observe_all(frame.pulse, frames.read(frame.pulse));
}

Mesh ViewColours::seen_by(const CameraModel& eye, Mesh mesh) const {
  std::vector<TextureCamera> cameras;
  for (const Frame& frame : set_.frames) {
    const auto index = static_cast<size_t>(find_camera(rig_, frame.camera));
    cameras.push_back({&rig_[index].model, &frame, &rig_[index].colour});
  }
  const double edge = edge_length(mesh);
  const TextureOptions options{.depth_tolerance_m = 3 * edge,
                               .occluder_radius_m = 0.71 * edge,
                               .view = ViewDependence{eye.viewing_direction()}};
  if (!mesh.vertices.empty()) mesh.colours = colour_vertices(mesh, cameras, options).colours;
  return mesh;
}

}  // namespace v3d::ctl
