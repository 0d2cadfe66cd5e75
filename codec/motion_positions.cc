#include "codec/motion_positions.h"

#include <bit>

namespace v3d::codec {

IntegerModel& PositionModels::of(uint32_t expected) {
  // Two classes for each power of two.
  const uint32_t clamped = std::min(expected, 1U << 15);
  const auto index = static_cast<size_t>(std::bit_width(clamped * clamped / 2));
  return models_[std::min(index, kClasses - 1)];
}

bool decode_positions(std::span<const uint8_t> bytes, const VertexHierarchy& hierarchy,
                      References references, PulseState& state) {
  RangeDecoder coder(bytes);
  state.positions.assign(hierarchy.order().size(), {});
  return code_positions(coder, hierarchy, references, {}, state) && coder.ended();
}

void finish_template(VertexHierarchy& hierarchy, PulseState& state) {
  hierarchy.fit_weights(state.positions);
  PositionPredictor predictor(hierarchy, {});
  for (const uint32_t v : hierarchy.order()) {
    predictor.move_to(v, state.positions);
    for (size_t axis = 0; axis < 3; ++axis) {
      state.laplacians[v][axis] = predictor.laplacian(axis, state.positions[v][axis]);
    }
  }
  std::fill(state.residuals.begin(), state.residuals.end(), uint8_t{0});
  std::fill(state.colour_residuals.begin(), state.colour_residuals.end(), std::array<uint8_t, 3>{});
}

}  // namespace v3d::codec
