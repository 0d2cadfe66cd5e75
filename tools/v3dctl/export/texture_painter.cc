#include "v3dctl/export/texture_painter.h"

#include <algorithm>
#include <vector>

#include "base/io/file.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "take/take.h"
#include "v3dctl/export/mesh_export.h"

namespace v3d::ctl {

TexturePainter::TexturePainter(const std::filesystem::path& take, const std::string& option)
    : rig_(take::load_take_calib({take})), cameras_({take}) {
  const take::TakePaths paths{take};
  const std::vector<std::string> cameras = take::load_take_info(paths).cameras;
  const bool recorded = std::ranges::any_of(
      cameras, [&](const std::string& camera) { return file_exists(paths.frames(camera)); });
  if (recorded) {
    frames_.emplace(require_raw_frames(take, option), std::vector<std::string>());
    rig_ = frames_->rig();
  } else {
    note("v3dctl: the texture has the colours of vertices: " + take.string() +
         " has no raw frames");
  }
}

recon::AtlasLayout TexturePainter::layout_of(const Mesh& mesh, int side) const {
  return recorded::atlas_layout(rig_, mesh, side);
}

recon::AtlasColours TexturePainter::paint(const Mesh& mesh, const recon::AtlasLayout& layout,
                                          int64_t pulse, const Mesh* whole) {
  if (!frames_) return recon::colour_atlas(mesh, layout, {}, {});
  const recorded::UsedCameras used = cameras_.at(pulse);
  const recorded::FrameColours colours(*frames_, used);
  if (colours.cameras() < used.names.size()) ++incomplete_;
  return colours.atlas_colours(mesh, layout, whole);
}

}  // namespace v3d::ctl
