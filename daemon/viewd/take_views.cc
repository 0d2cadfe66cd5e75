#include "daemon/viewd/take_views.h"

#include <algorithm>

#include "base/core/error.h"
#include "daemon/recorded/frame_colours.h"
#include "daemon/viewd/view_json.h"
#include "take/take.h"

namespace v3d {

std::optional<std::string> TakeViews::tag(const std::filesystem::path& take) {
  const TakePaths paths{take};
  const auto mesh = stamp_of(paths.mesh()), info = stamp_of(paths.info()),
             calib = stamp_of(paths.calib());
  if (!mesh || !info || !calib) return {};
  std::string tag = std::to_string(mesh->inode) + tag_of(*mesh) + tag_of(*calib);
  for (const std::string& camera : load_take_info(paths).cameras) {
    const auto log = stamp_of_log(paths.frames(camera));
    if (!log) return {};
    tag += tag_of(*log);
  }
  std::erase(tag, '"');
  return '"' + tag + '"';
}

std::optional<std::string> TakeViews::read(const std::string& take, int64_t pulse) {
  OpenTake& opened = open(take, pulse);
  if (!std::ranges::binary_search(opened.pulses, pulse)) return {};
  const CompactFrame frame = opened.meshes->read(pulse);
  FrameSet set = observe_all(pulse, opened.frames.read(pulse));
  std::erase_if(set.frames, [&](const Frame& seen) {
    return std::ranges::find(frame.cameras, seen.camera) == frame.cameras.end();
  });
  const Rig& rig = opened.frames.rig();
  return vertex_views_message(
      pulse, static_cast<int64_t>(frame.mesh.vertices.size()),
      camera_colours(frame.mesh, texture_cameras(rig, set), texture_options(frame.mesh)), rig);
}

bool TakeViews::has_grown(const OpenTake& take, const FileStamp& mesh, int64_t pulse) {
  return mesh.inode == take.mesh.inode && mesh.size > take.mesh.size &&
         std::ranges::binary_search(take.pulses, pulse);
}

TakeViews::OpenTake& TakeViews::open(const std::string& take, int64_t pulse) {
  const auto current = tag(takes_ / take);
  const auto mesh = stamp_of(TakePaths{takes_ / take}.mesh());
  if (!current || !mesh) {
    throw InputError((takes_ / take).string() + ": no meshes, or not all raw frames");
  }
  const auto known = std::ranges::find(open_, take, &OpenTake::name);
  if (known != open_.end() && (known->tag == *current || has_grown(*known, *mesh, pulse))) {
    open_.splice(open_.begin(), open_, known);
    return open_.front();
  }
  if (known != open_.end()) open_.erase(known);
  auto meshes = std::make_unique<MeshFrames>(takes_ / take);
  std::vector<int64_t> pulses = meshes->frames({});
  open_.push_front(
      {take, *current, *mesh, std::move(meshes), TakeFrames(takes_ / take, {}), std::move(pulses)});
  if (open_.size() > kMaxTakes) open_.pop_back();
  return open_.front();
}

}  // namespace v3d
