#include "codec/frame_parts.h"

#include <algorithm>

namespace v3d {

ValueRange position_range(const FrameHeader& header) {
  ValueRange range;
  if (header.is(FrameHeader::kExplicit)) {
    range.most.fill(kMostLatticeNumber);
  } else {
    range.least.fill(-kMostDisplacement);
    range.most.fill(kMostDisplacement);
  }
  return range;
}

namespace {

float position(const FrameFacts& facts, int axis, int64_t number) {
  return static_cast<float>(facts.origin[axis] + static_cast<double>(number) * facts.step);
}

/// Where the places of a lattice lie along an axis.
std::vector<float> positions_along(const FrameHeader& header, int axis) {
  const int first = 2 * kBrickEdge * header.first_brick[axis];
  std::vector<float> positions;
  for (int place = first; place <= first + 2 * kBrickEdge * header.bricks[axis]; ++place) {
    positions.push_back(position(header.facts, axis, int64_t{place} * header.subdivision));
  }
  return positions;
}

void place_on_lattice(const FrameState& state, std::span<VertexPosition> out) {
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<float> positions = positions_along(state.header, axis);
    const int first = 2 * kBrickEdge * state.header.first_brick[axis];
    for (size_t v = 0; v < out.size(); ++v) {
      out[v][axis] = positions[static_cast<size_t>(state.surface.places[v][axis] - first)];
    }
  }
}

void place_beside_lattice(const FrameState& state, std::span<VertexPosition> out) {
  const FrameHeader& header = state.header;
  const bool on_lattice = !header.is(FrameHeader::kExplicit);
  for (size_t v = 0; v < out.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const int64_t place =
          on_lattice ? int64_t{state.surface.places[v][axis]} * header.subdivision : 0;
      out[v][axis] = position(header.facts, axis, place + state.displacements[v][axis]);
    }
  }
}

}  // namespace

void make_mesh(const FrameState& state, DecodedFrame& out) {
  out.facts = state.header.facts;
  out.key_pulse = state.header.key_pulse;
  out.positions.resize(state.header.vertices);
  state.displacements.empty() ? place_on_lattice(state, out.positions)
                              : place_beside_lattice(state, out.positions);
  const std::vector<VertexValues>& colours = state.surface.colours;
  out.colours.resize(colours.size());
  std::transform(colours.begin(), colours.end(), out.colours.begin(), colour_of);
}

}  // namespace v3d
