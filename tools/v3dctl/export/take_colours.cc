#include "v3dctl/export/take_colours.h"

#include <algorithm>
#include <map>

#include "base/core/error.h"
#include "daemon/recorded/frame_colours.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Throws InputError for a take that was kept without its raw frames.
const fs::path& require_frames(const fs::path& take) {
  const TakePaths paths{take};
  for (const std::string& camera : load_take_info(paths).cameras) {
    if (!fs::exists(paths.frames(camera))) {
      throw InputError("--view-dependent: the take has no raw frames of " + camera + ": " +
                       paths.frames(camera).string() + " does not exist");
    }
  }
  return take;
}

void require_distinct(const std::vector<std::string>& cameras) {
  std::map<std::string, std::string> camera_of;
  for (const std::string& camera : cameras) {
    std::string name = attribute_name(camera);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    const auto [before, added] = camera_of.emplace(name, camera);
    if (!added) {
      throw InputError("--view-dependent: the cameras " + before->second + " and " + camera +
                       " have the same attribute name, " + name);
    }
  }
}

}  // namespace

TakeColours::TakeColours(const fs::path& take) : frames_(require_frames(take), {}) {
  require_distinct(frames_.info().cameras);
}

std::vector<ExportedCamera> TakeColours::of(const CompactFrame& frame) {
  const FrameSet set = observe_all(frame.pulse, frames_.read(frame.pulse));
  if (set.frames.empty()) {
    throw InputError("--view-dependent: " + frames_.paths().folder.string() +
                     " has no raw frames of pulse " + std::to_string(frame.pulse));
  }
  if (set.frames.size() < frames_.rig().size()) ++incomplete_;
  std::vector<CameraColours> visible =
      camera_colours(frame.mesh, texture_cameras(frames_.rig(), set), texture_options(frame.mesh));
  std::vector<ExportedCamera> cameras;
  for (const RigCamera& camera : frames_.rig()) {
    const auto found =
        std::find_if(visible.begin(), visible.end(),
                     [&](const CameraColours& colours) { return colours.camera == camera.name; });
    ExportedCamera& exported = cameras.emplace_back();
    exported.centre = camera.model.center();
    exported.axis = camera.model.viewing_direction();
    exported.colours = {camera.name, {}};
    exported.colours.vertices.resize(frame.mesh.vertices.size());
    if (found != visible.end()) exported.colours = std::move(*found);
  }
  return cameras;
}

}  // namespace v3d::ctl
