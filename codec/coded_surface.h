// Surface of a frame as encoder and decoder derive it from the occupancy alone, plus decoded
// colours.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/brick_surface.h"
#include "codec/colour_code.h"
#include "codec/known_vertices.h"
#include "codec/occupancy.h"
#include "codec/vertex_values.h"

namespace v3d {

/// Surface of one frame, in the order of the discrete marching cubes. Keeps its memory.
struct CodedSurface {
  Occupancy volume;
  BrickSurface surface;
  std::vector<HalfVoxels> places;  ///< [vertex]: position in half voxels of the whole grid
  std::vector<std::array<uint32_t, 3>> triangles;
  KnownVertices known;
  std::vector<LumaChroma> colours;  ///< [vertex]: decoded colours; empty: none

  /// Computes the surface bricks of `volume` and counts vertices and triangles.
  void measure();
  /// These require measure(). make_known() also requires make_triangles().
  void make_places();
  void make_triangles();
  void make_known() { known.make(triangles, surface.vertex_count()); }
  /// The colour of the vertex on an edge of the whole grid; null when the edge has no vertex.
  const LumaChroma* colour_on(const LatticeEdge& edge) const;
};

/// Colours of frame `before` at the vertices of frame `now`: on the same edge, or one voxel along
/// it. Borrows both.
class PreviousFrameColours : public PreviousColours {
 public:
  PreviousFrameColours(const CodedSurface& before, const CodedSurface& now)
      : before_(before), now_(now) {}
  const LumaChroma* at(uint32_t vertex) const override;

 private:
  const CodedSurface& before_;
  const CodedSurface& now_;
};

}  // namespace v3d
