// Surface derived from the occupancy; parts shared by encoder and decoder.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/bricks.h"
#include "codec/colour_code.h"
#include "codec/frame_codec.h"
#include "codec/occupancy.h"
#include "codec/vertex_values.h"

namespace v3d::codec {

// Surface of a frame as encoder and decoder derive it from the occupancy alone, plus decoded
// colours.

/// Surface of one frame, in the order of the discrete marching cubes. Keeps its memory.
struct CodedSurface {
  Occupancy volume;
  BrickSurface surface;
  std::vector<HalfVoxels> positions;  ///< [vertex]: in half voxels of the whole grid
  std::vector<std::array<uint32_t, 3>> triangles;
  KnownVertices known;
  std::vector<LumaChroma> colours;  ///< [vertex]: decoded colours; empty: none

  /// Computes the surface bricks of `volume` and counts vertices and triangles.
  void measure();
  /// These require measure(). make_known() also requires make_triangles().
  void make_positions();
  void make_triangles();
  void make_known() { known.make(triangles, surface.vertex_count()); }
  /// The vertex on an edge of the whole grid; below 0 when the edge has none.
  int64_t vertex_on(const LatticeEdge& edge) const;
};

/// The vertex of frame `before` from which `vertex` of frame `now` is predicted: on the same edge,
/// or one voxel along it. Below 0: none.
int64_t previous_vertex(const CodedSurface& before, const CodedSurface& now, uint32_t vertex);

/// Colours of frame `before` at the vertices of frame `now`, see previous_vertex(). Borrows both.
class PreviousFrameColours : public PreviousColours {
 public:
  PreviousFrameColours(const CodedSurface& before, const CodedSurface& now)
      : before_(before), now_(now) {}
  const LumaChroma* at(uint32_t vertex) const override;

 private:
  const CodedSurface& before_;
  const CodedSurface& now_;
};

// Parts shared by the encoder and the decoder of frames.

/// A CameraView relative to the colours of the frame.
struct CameraResiduals {
  CameraAxis axis{};
  /// [vertex]: luma, Co and Cg less those of the frame, and 1 for a vertex that the camera sees.
  std::vector<LumaChroma> vertices;
};

/// State of a frame; the next frame is predicted from it.
struct FrameState {
  FrameHeader header;
  CodedSurface surface;
  /// [vertex]: position in lattice steps from the origin. Empty: vertices lie where the volume has
  /// them.
  std::vector<VertexValues> numbers;
  std::vector<uint8_t> labels;           ///< [vertex]: performer; empty: none
  std::vector<CameraResiduals> cameras;  ///< of metadata.cameras; empty: none
};

inline constexpr int kMaxDisplacement = 32767;
inline constexpr int kMaxLatticeNumber = 65535;

/// Range of displacements, or of positions in a frame without a volume.
ValueRange position_range(const FrameHeader& header);

/// Positions of vertices after smoothing of the voxel steps, in lattice steps. Displacements are
/// relative to them. For a smooth deformed surface they are closer than the vertices of the volume.
/// Normative: docs/compact-frame.md.
std::vector<VertexValues> smoothed_positions(const CodedSurface& surface, int subdivision);

std::vector<VertexColour> colours_of(std::span<const LumaChroma> values);

/// Fills all of `out` except its triangles, which are those of state.surface.
void make_mesh(const FrameState& state, DecodedFrame& out);

}  // namespace v3d::codec
