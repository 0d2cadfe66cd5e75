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
  /// [vertex]: steps of the lattice from its origin. Empty: vertices are where the volume has them.
  std::vector<VertexValues> numbers;
};

inline constexpr int kMostDisplacement = 32767;
inline constexpr int kMostLatticeNumber = 65535;

/// Of displacements, or of the positions of a frame without a volume.
ValueRange position_range(const FrameHeader& header);

/// Where vertices of a volume would lie if the steps of its voxels were smoothed away, in steps of
/// the lattice: what displacements are counted from. For surfaces that were moved to where they are
/// smooth, that is nearer than where the volume has them. Normative: docs/compact-frame.md.
std::vector<VertexValues> smoothed_places(const CodedSurface& surface, int subdivision);

std::vector<VertexColour> colours_of(std::span<const LumaChroma> values);

/// All of `out` but its triangles, which are those of state.surface.
void make_mesh(const FrameState& state, DecodedFrame& out);

}  // namespace v3d
