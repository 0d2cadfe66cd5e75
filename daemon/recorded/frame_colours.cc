#include "daemon/recorded/frame_colours.h"

#include "base/core/error.h"
#include "recon/mesh/mesh_edges.h"

namespace v3d {

TextureOptions texture_options(const Mesh& mesh) {
  const double edge = mean_edge(mesh);
  TextureOptions options;
  options.depth_tolerance_m = 3 * edge;
  options.occluder_radius_m = 0.71 * edge;
  options.demosaic = true;
  options.by_resolution = true;
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

FrameColours::FrameColours(const std::filesystem::path& take, const CompactFrame& frame) {
  TakeFrames frames(take, frame.cameras);
  rig_ = frames.rig();
  set_ = observe_all(frame.pulse, frames.read(frame.pulse));
  if (set_.frames.size() == frame.cameras.size()) return;
  throw InputError(frames.paths().folder.string() + ": pulse " + std::to_string(frame.pulse) +
                   ": frames of " + std::to_string(set_.frames.size()) + " of its " +
                   std::to_string(frame.cameras.size()) +
                   " cameras can be read; see v3dctl verify");
}

Mesh FrameColours::coloured(Mesh mesh) const { return coloured(std::move(mesh), std::nullopt); }

Mesh FrameColours::coloured_for(const CameraModel& eye, Mesh mesh) const {
  return coloured(std::move(mesh), ViewDependence{eye.viewing_direction()});
}

Mesh FrameColours::coloured(Mesh mesh, std::optional<ViewDependence> view) const {
  if (mesh.vertices.empty()) return mesh;
  TextureOptions options = texture_options(mesh);
  options.view = view;
  mesh.colours = colour_vertices(mesh, texture_cameras(rig_, set_), options).colours;
  return mesh;
}

}  // namespace v3d
