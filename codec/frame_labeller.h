// Adds labels to the frames of a sequence without encoding the rest again.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "codec/frame_codec.h"

namespace v3d::codec {

/// One caller at a time.
class FrameLabeller {
 public:
  /// Decodes the next frame, as FrameDecoder does.
  DecodeStatus decode(std::span<const uint8_t> bytes);
  /// The last decoded frame. Valid until the next call of decode().
  const DecodedFrame& frame() const { return decoder_.frame(); }
  /// The last decoded frame with `labels` instead of those that it had: one for each vertex, or
  /// empty for none. The results form a sequence, as the decoded frames do. Call it once for each
  /// decoded frame.
  std::vector<uint8_t> labelled(std::span<const uint8_t> labels);

 private:
  FrameDecoder decoder_;
  std::vector<uint8_t> bytes_;  ///< of frame()
  uint32_t checksum_ = 0;       ///< of the last result
};

}  // namespace v3d::codec
