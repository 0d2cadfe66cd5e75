// Levels of video codecs: the sizes and rates of pictures that a decoder of a level can decode.
#pragma once

#include <optional>
#include <string>

namespace v3d::ctl {

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
