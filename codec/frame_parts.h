// What encoder and decoder of frames share.
#pragma once

#include <span>
#include <vector>

#include "codec/coded_surface.h"
#include "codec/frame_codec.h"

namespace v3d {

/// A frame, and what the next one is predicted from.
struct FrameState {
  FrameHeader header;
  CodedSurface surface;
  std::vector<VertexValues> displacements;  ///< in lattice steps; of explicit frames the positions
};

inline constexpr int kMostDisplacement = 32767;
inline constexpr int kMostLatticeNumber = 65535;

/// Of displacements, or of the positions of a frame without a volume.
ValueRange position_range(const FrameHeader& header);

/// All of `out` but its triangles, which are those of state.surface.
void make_mesh(const FrameState& state, DecodedFrame& out);

}  // namespace v3d
