// Delivery of a take as a folder that a player plays: tracked surfaces, and their texture as video.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

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

// Levels of video codecs: the sizes and rates of pictures that a decoder of a level can decode:
// video_levels.cc

struct VideoLevel {
  std::string name;   ///< "5.1"
  std::string codec;  ///< codec, profile and level in a media type (RFC 6381): "avc1.640033"
};

/// The lowest level from 4.0 on that includes square pictures of `side` pixels at `rate_hz`; empty:
/// no level does. H.264 has the High profile; AV1 the Main profile and tier, and 8 bits.
/// Sources: ITU-T H.264, table A-1; AV1 Bitstream and Decoding Process Specification, annex A.3.
std::optional<VideoLevel> h264_level(int side, double rate_hz);
std::optional<VideoLevel> av1_level(int side, double rate_hz);

/// The largest even side, pixels, for which both codecs have a level.
int max_video_side(double rate_hz);

}  // namespace v3d::ctl
