// Parts shared by the encoder and the decoder of frames.
#pragma once

#include <span>
#include <vector>

#include "codec/coded_surface.h"
#include "codec/frame_codec.h"

namespace v3d {

/// State of a frame; the next frame is predicted from it.
struct FrameState {
  FrameHeader header;
  CodedSurface surface;
  /// [vertex]: position in lattice steps from the origin. Empty: vertices lie where the volume has
  /// them.
  std::vector<VertexValues> numbers;
};

inline constexpr int kMaxDisplacement = 32767;
inline constexpr int kMaxLatticeNumber = 65535;

/// Range of displacements, or of positions in a frame without a volume.
ValueRange position_range(const FrameHeader& header);

/// Positions of vertices after smoothing of the voxel steps, in lattice steps. Displacements are
/// relative to them. For a smooth deformed surface they are closer than the vertices of the volume.
/// Normative: docs/compact-frame.md.
std::vector<VertexValues> smoothed_places(const CodedSurface& surface, int subdivision);

std::vector<VertexColour> colours_of(std::span<const LumaChroma> values);

/// Fills all of `out` except its triangles, which are those of state.surface.
void make_mesh(const FrameState& state, DecodedFrame& out);

}  // namespace v3d
