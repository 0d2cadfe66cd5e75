// Replaces the optional sections of the frames of a sequence without encoding the rest again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "codec/coded_surface.h"
#include "codec/frame_codec.h"
#include "codec/frame_header.h"

namespace v3d::codec {

/// Decodes each frame, then makes a revised one of it. The results form a sequence, as the decoded
/// frames do. Call one function that makes a frame once for each decoded frame. One caller at a
/// time.
class FrameReviser {
 public:
  /// Decodes the next frame, as FrameDecoder does.
  DecodeStatus decode(std::span<const uint8_t> bytes);
  /// The last decoded frame. Valid until the next call of decode().
  const DecodedFrame& frame() const { return decoder_.frame(); }

  /// The last decoded frame with `labels` instead of those that it had: one for each vertex, or
  /// empty for none.
  std::vector<uint8_t> labelled(std::span<const uint8_t> labels);

  /// The last decoded frame with the colours of cameras instead of those that it had. `views`: one
  /// for each camera of the frame, with an entry for each vertex; or empty for none. Their section
  /// has the finest step of luma with at most `max_bytes` bytes; with the coarsest step it may be
  /// larger.
  ///
  /// The frame has none when it has no colours, or more than FrameLimits::kCameraColours vertices
  /// times cameras.
  std::vector<uint8_t> with_cameras(std::span<const CameraView> views, size_t max_bytes);

  /// Of the last result of with_cameras(): bytes of the section, 0 without it, and step of luma.
  struct CameraCost {
    size_t bytes = 0;
    int step = 0;
  };
  CameraCost camera_cost() const { return cost_; }

 private:
  struct Revision {
    FrameHeader header;
    Sections sections;
  };
  /// The last decoded frame in parts.
  Revision revision() const;
  std::vector<uint8_t> finish(Revision& revision);
  void encode_views(std::span<const CameraView> views, size_t max_bytes, Revision& revision);

  FrameDecoder decoder_;
  std::vector<uint8_t> bytes_;              ///< of frame()
  uint32_t checksum_ = 0;                   ///< of the last result
  std::vector<CameraResiduals> residuals_;  ///< of the last result; empty: none
  std::vector<std::string> cameras_;        ///< of the last result
  CameraCost cost_;
};

}  // namespace v3d::codec
