// A compact frame as the rest of the project knows it: what it says of itself, and its mesh. The
// format: codec/frame_codec.h.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/mesh.h"
#include "base/time.h"
#include "codec/frame_codec.h"
#include "recon/mesh/vertex_lattice.h"

namespace v3d {

struct CompactFrame {
  int64_t pulse = 0;
  RealtimeInstant exposure;          ///< start: the pulse's edge; 0 when unknown
  std::vector<std::string> cameras;  ///< that took part, ascending
  int missing = 0;                   ///< cameras of the rig that did not
  float quality =
      std::numeric_limits<float>::quiet_NaN();  ///< 0 to 1, more is better; NaN: unknown
  VertexLattice lattice;
  Mesh mesh;
};

/// Decodes a sequence: FrameDecoder's contract.
class CompactDecoder {
 public:
  DecodeStatus decode(std::span<const uint8_t> bytes) { return decoder_.decode(bytes); }
  /// The last frame decoded.
  CompactFrame frame() const;

 private:
  FrameDecoder decoder_;
};

/// One key frame; empty for any other bytes.
std::optional<CompactFrame> decode_compact(std::span<const uint8_t> bytes);

/// What an encoder makes of the mesh's colours, and back.
std::vector<VertexColour> vertex_colours(std::span<const Rgb8> colours);
std::vector<Rgb8> rgb_colours(std::span<const VertexColour> colours);
std::vector<VertexPosition> vertex_positions(std::span<const Eigen::Vector3f> vertices);

}  // namespace v3d
