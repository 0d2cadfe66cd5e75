// Delivery of a take as a folder that a player plays: tracked surfaces, and their texture as video.
#pragma once

#include <filesystem>

#include "take/take.h"

namespace v3d::ctl {

struct VolumeExport {
  std::filesystem::path take, out;
  take::FrameRange frames = {};
  int atlas_side = 2048;      ///< texels, even
  bool uncompressed = false;  ///< also the texture of each pulse, textures/000012.png
};

/// Writes the folder `out`, which appears when it is complete: manifest.json, motion.v3d,
/// segment-000.glb and so on, texture-h264.mp4 and texture-av1.mp4. docs/export.md describes them.
///
/// The texture has the colours of the raw frames. Those of the vertices take their place for a take
/// without raw frames, such as an edited one. The videos have the take's sound in step, where it
/// has any. Reports the pulses without a surface, and cameras without frames, in a line each on
/// stderr. Returns the exit status. Throws InputError for a take without a tracked surface, for
/// pulses that it does not have, for a texture that exceeds all levels of videos, without ffmpeg,
/// and when `out` is a folder with files; std::runtime_error with the path for errors of the disk.
int export_volume(const VolumeExport& request);

}  // namespace v3d::ctl
