// What encoder and decoder know of a frame beside its values: both make it of the occupancy alone.
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

/// One frame's surface, in the order of the discrete marching cubes. Keeps its memory.
struct CodedSurface {
  Occupancy volume;
  BrickSurface surface;
  std::vector<HalfVoxels> places;  ///< [vertex], of the whole grid
  std::vector<std::array<uint32_t, 3>> triangles;
  KnownVertices known;
  std::vector<LumaChroma> colours;  ///< [vertex], as decoded; empty: none

  /// Counts the surface of `volume`.
  void measure();
  /// Require measure(). `known` is made of the triangles.
  void make_places();
  void make_triangles();
  void make_known() { known.make(triangles, surface.vertex_count()); }
  /// Null where no vertex stands.
  const LumaChroma* colour_on(const LatticeEdge& edge) const;
};

/// Colours of `before` where the vertices of `now` stand: on the same edge, or one voxel along it.
/// Borrows both.
class ColoursBefore : public FormerColours {
 public:
  ColoursBefore(const CodedSurface& before, const CodedSurface& now) : before_(before), now_(now) {}
  const LumaChroma* at(uint32_t vertex) const override;

 private:
  const CodedSurface& before_;
  const CodedSurface& now_;
};

}  // namespace v3d
