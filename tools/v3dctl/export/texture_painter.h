// Textures of the surfaces of a take, from its raw frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/texture/atlas_colours.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::ctl {

/// One thread; uses several processors. Fast for increasing pulses.
class TexturePainter {
 public:
  /// A take without raw frames, such as an edited one, gets the colours of vertices; a line on
  /// stderr says so. Throws InputError, beginning with `option`, when only some cameras have them.
  TexturePainter(const std::filesystem::path& take, const std::string& option);

  /// recorded::atlas_layout() with the cameras of the take.
  recon::AtlasLayout layout_of(const Mesh& mesh, int side) const;
  /// The colours of `mesh`, which has colours of vertices, at a pulse, from the cameras that took
  /// part in its reconstruction (recorded::MeshCameras). `whole` is the surface of
  /// all performers, which may hide `mesh`; null: `mesh` is all.
  recon::AtlasColours paint(const Mesh& mesh, const recon::AtlasLayout& layout, int64_t pulse,
                            const Mesh* whole = nullptr);
  /// Number of pulses so far in which such a camera was missing or unreadable.
  int64_t incomplete() const { return incomplete_; }

 private:
  /// Of the cameras that were recorded; calib.toml has all cameras of the studio.
  Rig rig_;
  recorded::MeshCameras cameras_;
  std::optional<recorded::TakeFrames> frames_;
  int64_t incomplete_ = 0;
};

}  // namespace v3d::ctl
