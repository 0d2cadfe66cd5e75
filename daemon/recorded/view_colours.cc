#include "daemon/recorded/view_colours.h"

#include <algorithm>

namespace v3d {
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

TextureOptions texture_options(const Mesh& mesh) {
  const double edge = edge_length(mesh);
  TextureOptions options;
  options.depth_tolerance_m = 3 * edge;
  options.occluder_radius_m = 0.71 * edge;
  return options;
}

std::vector<TextureCamera> texture_cameras(const Rig& rig, const FrameSet& set) {
  std::vector<TextureCamera> cameras;
  for (const Frame& frame : set.frames) {
    const auto index = static_cast<size_t>(find_camera(rig, frame.camera));
    cameras.push_back({&rig[index].model, &frame, &rig[index].colour});
  }
  return cameras;
}

ViewColours::ViewColours(const std::filesystem::path& take, const CompactFrame& frame) {
  TakeFrames frames(take, frame.cameras);
  rig_ = frames.rig();
  set_ = observe_all(frame.pulse, frames.read(frame.pulse));
}

Mesh ViewColours::seen_by(const CameraModel& eye, Mesh mesh) const {
  if (mesh.vertices.empty()) return mesh;
  TextureOptions options = texture_options(mesh);
  options.view = ViewDependence{eye.viewing_direction()};
  mesh.colours = colour_vertices(mesh, texture_cameras(rig_, set_), options).colours;
  return mesh;
}

}  // namespace v3d
