#include "v3dctl/export/training_pulse.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/texture/texture.h"
#include "v3dctl/export/mesh_export.h"

namespace v3d::ctl {
namespace {

using SeenVertices = std::vector<std::array<uint8_t, 4>>;  // as CameraColours::vertices

TrainingView view_of(const RigCamera& camera, const recorded::SegmentedFrame& frame) {
  TrainingView view;
  view.camera = camera.name;
  view.model = recon::pinhole_of(camera.model, camera.name);
  Image image = to_rgb(frame.raw.image.view());
  if (!camera.colour.is_identity()) correct(image, camera.colour);
  view.picture = recon::undistorted({std::move(image), frame.mask}, camera.model, view.model);
  return view;
}

/// The vertices that the camera sees.
std::vector<PointInImage> points_in(const TrainingView& view, const CameraModel& camera,
                                    const std::vector<Eigen::Vector3f>& vertices,
                                    const SeenVertices& seen) {
  std::vector<PointInImage> points;
  for (size_t v = 0; v < seen.size(); ++v) {
    if (seen[v][3] == static_cast<uint8_t>(recon::Visibility::kNone)) continue;
    const auto pixel = recon::undistorted_pixel(vertices[v].cast<double>(), camera, view.model);
    if (pixel) points.push_back({v, *pixel});
  }
  return points;
}

/// Keeps the vertices that are in a view. Points of the views refer to the shorter list.
void keep_seen_points(const Mesh& mesh, TrainingPulse& pulse) {
  constexpr size_t kUnseen = SIZE_MAX;
  std::vector<size_t> number(mesh.vertices.size(), kUnseen);
  for (const TrainingView& view : pulse.views) {
    for (const PointInImage& point : view.points) number[point.point] = 0;
  }
  for (size_t v = 0; v < number.size(); ++v) {
    if (number[v] == kUnseen) continue;
    number[v] = pulse.points.vertices.size();
    pulse.points.vertices.push_back(mesh.vertices[v]);
    if (!mesh.colours.empty()) pulse.points.colours.push_back(mesh.colours[v]);
  }
  for (TrainingView& view : pulse.views) {
    for (PointInImage& point : view.points) point.point = number[point.point];
  }
}

}  // namespace

TrainingPulses::TrainingPulses(const std::filesystem::path& take, const std::string& option)
    : option_(option), frames_(require_raw_frames(take, option), {}) {}

TrainingPulse TrainingPulses::of(const recon::CompactFrame& frame) {
  const auto frames = recorded::read_used(recorded::used_cameras(frame), frames_);
  const recon::FrameSet set = observe_all(frame.pulse, frames);
  if (set.frames.empty()) {
    throw InputError(option_ + ": " + frames_.paths().folder.string() +
                     " has no raw frames of pulse " + std::to_string(frame.pulse));
  }
  if (set.frames.size() < frame.cameras.size()) ++incomplete_;
  const Rig& rig = frames_.rig();
  const std::vector<recon::CameraColours> seen = camera_colours(
      frame.mesh, recorded::texture_cameras(rig, set), recorded::texture_options(frame.mesh));
  std::vector<TrainingView> views(rig.size());
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t c) {
    if (!frames[c]) return;
    views[c] = view_of(rig[c], *frames[c]);
    for (const recon::CameraColours& colours : seen) {
      if (colours.camera != rig[c].name) continue;
      views[c].points = points_in(views[c], rig[c].model, frame.mesh.vertices, colours.vertices);
    }
  });
  std::erase_if(views, [](const TrainingView& view) { return view.camera.empty(); });
  TrainingPulse pulse{{}, std::move(views)};
  keep_seen_points(frame.mesh, pulse);
  return pulse;
}

}  // namespace v3d::ctl
