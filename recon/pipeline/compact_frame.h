// A decoded compact frame: metadata and mesh. Format: codec/frame_codec.h and
// docs/compact-frame.md.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "base/geometry/mesh.h"
#include "codec/frame_codec.h"

namespace v3d::recon {

struct CompactFrame {
  int64_t pulse = 0;
  RealtimeInstant exposure;          ///< start of the exposure: edge of the pulse; 0: unknown
  std::vector<std::string> cameras;  ///< cameras that took part, ascending
  /// Of `cameras`, those whose image of the next pulse was used, because they are a pulse late;
  /// ascending.
  std::vector<std::string> late_cameras{};
  int missing = 0;  ///< number of cameras of the rig that did not take part
  float quality =
      std::numeric_limits<float>::quiet_NaN();  ///< 0 to 1, more is better; NaN: unknown
  int live_passes = 0;  ///< of LivePass, the first so many; 0: none, or another deformation
  std::vector<uint8_t> performers;       ///< of each vertex, 0: unknown; empty: not stated
  std::vector<codec::CameraView> views;  ///< of `cameras`; empty: none, or not enabled
  VertexLattice lattice;
  Mesh mesh;
};

/// Decodes a sequence of frames; the contract is that of FrameDecoder.
class CompactDecoder {
 public:
  codec::DecodeStatus decode(std::span<const uint8_t> bytes) { return decoder_.decode(bytes); }
  void enable_cameras(bool enabled) { decoder_.enable_cameras(enabled); }
  /// The last decoded frame.
  CompactFrame frame() const;

 private:
  codec::FrameDecoder decoder_;
};

/// The mesh of a decoded frame.
Mesh mesh_of(const codec::DecodedFrame& decoded);

/// Decodes one key frame; empty for any other bytes.
std::optional<CompactFrame> decode_compact(std::span<const uint8_t> bytes);

/// The triangles whose three vertices belong to `performer`; `performers`: that of each vertex, or
/// empty.
std::vector<std::array<uint32_t, 3>> triangles_of_performer(const Mesh& mesh,
                                                            std::span<const uint8_t> performers,
                                                            int performer);

/// Conversions between the types of meshes and of the codec.
std::vector<codec::VertexColour> vertex_colours(std::span<const Rgb8> colours);
std::vector<Rgb8> rgb_colours(std::span<const codec::VertexColour> colours);
std::vector<codec::VertexPosition> vertex_positions(std::span<const Eigen::Vector3f> vertices);

}  // namespace v3d::recon
