// Colours for one viewpoint: the paper's view-dependent rendering needs the pictures again, which a
// compact frame does not hold.
#pragma once

#include "daemon/recorded/take_frames.h"
#include "recon/compact_frame.h"
#include "recon/texture.h"

namespace v3d {

/// How far vertices may hide each other, by the lengths of the mesh's edges.
TextureOptions texture_options(const Mesh& mesh);

/// The frames of `set` with their cameras of `rig`: borrowed from both.
std::vector<TextureCamera> texture_cameras(const Rig& rig, const FrameSet& set);

/// The colours of a reconstructed frame as Algorithm 2 blends them for the camera that looks. Reads
/// the frames of the cameras that took part from the take. One thread.
class ViewColours {
 public:
  /// Reads the frame's pictures; throws InputError where the take no longer has them.
  ViewColours(const std::filesystem::path& take, const CompactFrame& frame);
  /// `mesh` is the frame's.
  Mesh seen_by(const CameraModel& eye, Mesh mesh) const;

 private:
  Rig rig_;
  FrameSet set_;
};

}  // namespace v3d
