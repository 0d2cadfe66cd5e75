#include "codec/motion_positions.h"

#include <algorithm>
#include <bit>

namespace v3d::codec {

size_t level_class(const VertexHierarchy& hierarchy, uint32_t vertex) {
  return std::min(static_cast<size_t>(hierarchy.level(vertex)), kLevelClasses - 1);
}

void PositionPredictor::move_to(uint32_t vertex, std::span<const LatticePosition> positions) {
  std::array<int64_t, 3> sum{};
  const auto neighbours = hierarchy_.neighbours(vertex);
  const auto weights = hierarchy_.weights(vertex);
  for (size_t n = 0; n < neighbours.size(); ++n) {
    const LatticePosition& position = positions[neighbours[n]];
    for (size_t axis = 0; axis < 3; ++axis) sum[axis] += int64_t{weights[n]} * position[axis];
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    mean_[axis] = static_cast<int32_t>(sum[axis] >> (VertexHierarchy::kWeightBits - kFractionBits));
  }
  for (size_t r = 0; r < references_.size(); ++r) {
    const LatticePosition& position = references_[r]->positions[vertex];
    const LatticePosition& laplacian = references_[r]->laplacians[vertex];
    for (size_t axis = 0; axis < 3; ++axis) {
      const int32_t mean = position[axis] * (1 << kFractionBits) - laplacian[axis];
      features_[2 * r][axis] = laplacian[axis];
      features_[2 * r + 1][axis] = mean_[axis] - mean;
    }
  }
}

int32_t PositionPredictor::predict(size_t axis, const PredictionCoefficients& coefficients) const {
  int64_t sum = 1 << (kCoefficientBits - 1);
  for (size_t f = 0; f < features(); ++f) sum += int64_t{coefficients[f]} * features_[f][axis];
  const int64_t predicted = mean_[axis] + (sum >> kCoefficientBits);
  const int64_t rounded = (predicted + (1 << (kFractionBits - 1))) >> kFractionBits;
  return static_cast<int32_t>(std::clamp(rounded, int64_t{-kMaxLattice}, int64_t{kMaxLattice}));
}

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
