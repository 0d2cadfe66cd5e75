#include "codec/coded_surface.h"

#include <algorithm>

namespace v3d::codec {

void CodedSurface::measure() {
  surface.begin(volume.view());
  for (size_t brick = 0; brick < surface.bricks().size(); ++brick) surface.examine(brick);
  surface.number();
}

void CodedSurface::make_positions() {
  positions.resize(surface.vertex_count());
  HalfVoxels origin;
  for (int axis = 0; axis < 3; ++axis) origin[axis] = 2 * kBrickEdge * volume.first[axis];
  for (size_t brick = 0; brick < surface.bricks().size(); ++brick) {
    surface.for_each_vertex(brick, [&](uint32_t vertex, const HalfVoxels& half) {
      for (int axis = 0; axis < 3; ++axis) positions[vertex][axis] = origin[axis] + half[axis];
    });
  }
}

void CodedSurface::make_triangles() {
  triangles.resize(surface.triangle_count());
  for (size_t brick = 0; brick < surface.bricks().size(); ++brick) {
    surface.write_triangles(brick, triangles);
  }
}

int64_t CodedSurface::vertex_on(const LatticeEdge& edge) const {
  LatticeEdge in_box = edge;
  for (int axis = 0; axis < 3; ++axis) in_box.voxel[axis] -= kBrickEdge * volume.first[axis];
  return surface.vertex_on(in_box);
}

int64_t previous_vertex(const CodedSurface& before, const CodedSurface& now, uint32_t vertex) {
  LatticeEdge edge = edge_at(now.positions[vertex]);
  for (const int move : {0, 1, -2}) {
    edge.voxel[edge.axis] += move;  // on this edge, then one voxel further, then one voxel back
    if (const int64_t found = before.vertex_on(edge); found >= 0) return found;
  }
  return -1;
}

const LumaChroma* PreviousFrameColours::at(uint32_t vertex) const {
  const int64_t found = previous_vertex(before_, now_, vertex);
  return found < 0 ? nullptr : &before_.colours[static_cast<size_t>(found)];
}

ValueRange position_range(const FrameHeader& header) {
  if (header.is(FrameHeader::kExplicit)) return {0, kMaxLatticeNumber};
  return {-kMaxDisplacement, kMaxDisplacement};
}

std::vector<VertexValues> smoothed_positions(const CodedSurface& surface, int subdivision) {
  // The fourth number counts the neighbours.
  std::vector<VertexValues> sums(surface.positions.size());
  const auto add = [&](uint32_t from, uint32_t to) {
    for (int axis = 0; axis < 3; ++axis) sums[to][axis] += surface.positions[from][axis];
    ++sums[to][3];
  };
  for (const auto& [a, b, c] : surface.triangles) {
    add(a, b);
    add(b, c);
    add(c, a);
  }
  for (size_t v = 0; v < sums.size(); ++v) {
    const int64_t count = sums[v][3];
    for (int axis = 0; axis < 3; ++axis) {
      // One third of its own position plus two thirds of the mean of its neighbours, rounded.
      const int64_t thirds = surface.positions[v][axis] * count + 2 * int64_t{sums[v][axis]};
      sums[v][axis] = static_cast<int32_t>((2 * thirds * subdivision + 3 * count) / (6 * count));
    }
    sums[v][3] = 0;
  }
  return sums;
}

namespace {

float position(const FrameMetadata& metadata, int axis, int64_t number) {
  return static_cast<float>(metadata.origin[axis] + static_cast<double>(number) * metadata.step);
}

/// Coordinates of the half voxels of the box along an axis, metres.
std::vector<float> positions_along(const FrameHeader& header, int axis) {
  const int first = 2 * kBrickEdge * header.first_brick[axis];
  const int last = first + 2 * kBrickEdge * header.bricks[axis];
  std::vector<float> positions;
  for (int half_voxel = first; half_voxel <= last; ++half_voxel) {
    positions.push_back(position(header.metadata, axis, int64_t{half_voxel} * header.subdivision));
  }
  return positions;
}

void place_on_lattice(const FrameState& state, std::span<VertexPosition> out) {
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<float> positions = positions_along(state.header, axis);
    const int first = 2 * kBrickEdge * state.header.first_brick[axis];
    for (size_t v = 0; v < out.size(); ++v) {
      out[v][axis] = positions[static_cast<size_t>(state.surface.positions[v][axis] - first)];
    }
  }
}

void place_by_number(const FrameState& state, std::span<VertexPosition> out) {
  for (size_t v = 0; v < out.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      out[v][axis] = position(state.header.metadata, axis, state.numbers[v][axis]);
    }
  }
}

}  // namespace

std::vector<VertexColour> colours_of(std::span<const LumaChroma> values) {
  std::vector<VertexColour> colours(values.size());
  std::transform(values.begin(), values.end(), colours.begin(), colour_of);
  return colours;
}

void make_mesh(const FrameState& state, DecodedFrame& out) {
  out.metadata = state.header.metadata;
  out.key_pulse = state.header.key_pulse;
  out.positions.resize(state.header.vertices);
  state.numbers.empty() ? place_on_lattice(state, out.positions)
                        : place_by_number(state, out.positions);
  out.colours = colours_of(state.surface.colours);
  out.labels = state.labels;
}

}  // namespace v3d::codec
