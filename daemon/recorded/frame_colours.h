// Vertex colours of a recorded frame from the images of the take: for one viewpoint (view-dependent
// rendering needs the images, which a compact frame does not contain), or for another surface.
#pragma once

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/texture/texture.h"

namespace v3d {

/// Options for recorded frames: occlusion tolerance by the edge lengths of the mesh, and full
/// demosaicing, because there is no deadline.
TextureOptions texture_options(const Mesh& mesh);

/// The frames of `set` with their cameras of `rig`. The result refers to both.
std::vector<TextureCamera> texture_cameras(const Rig& rig, const FrameSet& set);

/// The images of one pulse, of the cameras that took part in its reconstruction. One thread.
class FrameColours {
 public:
  /// Reads the frames. Throws InputError if the take has no readable frame of such a camera.
  FrameColours(const std::filesystem::path& take, const CompactFrame& frame);
  /// `mesh`, that of the frame or another one of the same pulse, with view-independent colours
  /// (equations 8 and 9).
  Mesh coloured(Mesh mesh) const;
  /// `mesh` with view-dependent colours for the viewpoint `eye` (Algorithm 2).
  Mesh coloured_for(const CameraModel& eye, Mesh mesh) const;

 private:
  Mesh coloured(Mesh mesh, std::optional<ViewDependence> view) const;

  Rig rig_;
  FrameSet set_;
};

}  // namespace v3d
