// The colours of a recorded frame from its pictures: for one viewpoint (the paper's view-dependent
// rendering needs the pictures again, which a compact frame does not hold), or for another surface.
#pragma once

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/texture/texture.h"

namespace v3d {

/// How far vertices may hide each other, by the lengths of the mesh's edges. The pictures of a
/// recorded frame are demosaiced whole: nobody waits.
TextureOptions texture_options(const Mesh& mesh);

/// The frames of `set` with their cameras of `rig`: borrowed from both.
std::vector<TextureCamera> texture_cameras(const Rig& rig, const FrameSet& set);

/// Reads the frames of the cameras that took part in a reconstruction from the take. One thread.
class FrameColours {
 public:
  /// Throws InputError where the take has no readable frame of a camera that took part.
  FrameColours(const std::filesystem::path& take, const CompactFrame& frame);
  /// `mesh`, the frame's or another of the same pulse, in the colours of equations (8) and (9).
  Mesh coloured(Mesh mesh) const;
  /// As Algorithm 2 blends them for the camera that looks.
  Mesh seen_by(const CameraModel& eye, Mesh mesh) const;

 private:
  Mesh coloured(Mesh mesh, std::optional<ViewDependence> view) const;

  Rig rig_;
  FrameSet set_;
};

}  // namespace v3d
