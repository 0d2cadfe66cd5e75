#include "codec/coded_surface.h"

namespace v3d {

void CodedSurface::measure() {
  surface.begin(volume.view());
  for (size_t brick = 0; brick < surface.bricks().size(); ++brick) surface.examine(brick);
  surface.number();
}

void CodedSurface::make_places() {
  places.resize(surface.vertex_count());
  HalfVoxels origin;
  for (int axis = 0; axis < 3; ++axis) origin[axis] = 2 * kBrickEdge * volume.first[axis];
  for (size_t brick = 0; brick < surface.bricks().size(); ++brick) {
    surface.for_each_vertex(brick, [&](uint32_t vertex, const HalfVoxels& half) {
      for (int axis = 0; axis < 3; ++axis) places[vertex][axis] = origin[axis] + half[axis];
    });
  }
}

void CodedSurface::make_triangles() {
  triangles.resize(surface.triangle_count());
  for (size_t brick = 0; brick < surface.bricks().size(); ++brick) {
    surface.write_triangles(brick, triangles);
  }
}

const LumaChroma* CodedSurface::colour_on(const LatticeEdge& edge) const {
  LatticeEdge in_box = edge;
  for (int axis = 0; axis < 3; ++axis) in_box.voxel[axis] -= kBrickEdge * volume.first[axis];
  const int64_t vertex = surface.vertex_on(in_box);
  return vertex < 0 ? nullptr : &colours[static_cast<size_t>(vertex)];
}

const LumaChroma* PreviousFrameColours::at(uint32_t vertex) const {
  LatticeEdge edge = edge_at(now_.places[vertex]);
  for (const int move : {0, 1, -2}) {
    edge.voxel[edge.axis] += move;  // on this edge, then one voxel further, then one voxel back
    if (const LumaChroma* colour = before_.colour_on(edge)) return colour;
  }
  return nullptr;
}

}  // namespace v3d
