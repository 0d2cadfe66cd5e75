// Coder of the positions of one pulse, shared by encoder and decoder: prediction and residuals.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "codec/motion_pulse.h"

namespace v3d::codec {

/// Coefficients of a prediction, in units of 1/4096: for each reference that of the Laplacian there
/// and that of the displacement of the neighbours since.
using PredictionCoefficients = std::array<int16_t, 2 * kMaxReferences>;
inline constexpr int kCoefficientBits = 12;

/// Levels of the hierarchy have coefficients of their own; the coarser ones share the last.
inline constexpr size_t kLevelClasses = 5;
using PulseCoefficients = std::array<PredictionCoefficients, kLevelClasses>;
/// Class of the level of a vertex.
size_t level_class(const VertexHierarchy& hierarchy, uint32_t vertex);

/// Predicts one vertex after the other. Integer arithmetic: the same bits everywhere.
class PositionPredictor {
 public:
  /// Bits of a Laplacian after the binary point.
  static constexpr int kFractionBits = 4;
  /// What the coefficients multiply, 1/16 step.
  using Features = std::array<LatticePosition, 2 * kMaxReferences>;

  PositionPredictor(const VertexHierarchy& hierarchy, References references)
      : hierarchy_(hierarchy), references_(references) {}

  /// Moves to a vertex whose coarse neighbours have their positions in `positions`.
  void move_to(uint32_t vertex, std::span<const LatticePosition> positions);

  size_t features() const { return 2 * references_.size(); }
  int32_t feature(size_t number, size_t axis) const { return features_[number][axis]; }
  /// The Laplacian of the vertex if it is at `position`.
  int32_t laplacian(size_t axis, int32_t position) const {
    return position * (1 << kFractionBits) - mean_[axis];
  }
  int32_t predict(size_t axis, const PredictionCoefficients& coefficients) const;

 private:
  const VertexHierarchy& hierarchy_;
  References references_;
  LatticePosition mean_{};  ///< weighted mean of the coarse neighbours, 1/16 step
  Features features_{};
};

// Coder of the positions of one pulse, shared by encoder and decoder.

/// Expects the magnitude of the residuals of a vertex, times eight: from its coarse neighbours,
/// from the first reference, and from those of its coordinates that are known.
class ExpectedResidual {
 public:
  ExpectedResidual(const VertexHierarchy& hierarchy, References references)
      : hierarchy_(hierarchy), references_(references) {}

  void move_to(uint32_t vertex, std::span<const uint8_t> residuals) {
    const auto neighbours = hierarchy_.neighbours(vertex);
    uint32_t sum = 0;
    for (const uint32_t other : neighbours) sum += residuals[other];
    around_ = 8 * sum / std::max(static_cast<uint32_t>(neighbours.size()), 1U) / 3;
    if (!references_.empty()) {
      around_ = (2 * around_ + 8U * references_[0]->residuals[vertex] / 3) / 3;
    }
    sum_ = 0;
  }
  uint32_t next(size_t axis) const {
    if (axis == 0) return around_;
    return axis == 1 ? (3 * around_ + 8 * sum_) / 4 : (around_ + 2 * sum_) / 2;
  }
  void add(int residual) { sum_ += static_cast<uint32_t>(std::abs(residual)); }
  /// Sum of the residuals of the vertex, clamped.
  uint8_t sum() const { return static_cast<uint8_t>(std::min(sum_, 255U)); }

 private:
  const VertexHierarchy& hierarchy_;
  References references_;
  uint32_t around_ = 0, sum_ = 0;
};

template <class Coder>
int16_t code_coefficient(Coder& coder, int16_t wanted) {
  uint32_t bits = 0;
  for (int digit = 15; digit >= 0; --digit) {
    bits = bits << 1 | uint32_t{coder.even_bit((wanted >> digit & 1) != 0)};
  }
  return static_cast<int16_t>(bits);
}

/// Codes state.positions, which the decoder overwrites. False for coordinates off the lattice, and
/// when the bytes of the decoder are exhausted.
template <class Coder>
bool code_positions(Coder& coder, const VertexHierarchy& hierarchy, References references,
                    PulseCoefficients coefficients, PulseState& state) {
  PositionPredictor predictor(hierarchy, references);
  for (PredictionCoefficients& of_class : coefficients) {
    for (size_t f = 0; f < predictor.features(); ++f) {
      of_class[f] = code_coefficient(coder, of_class[f]);
    }
  }
  state.laplacians.resize(state.positions.size());
  state.residuals.assign(state.positions.size(), 0);
  if (!references.empty()) state.position_models = references[0]->position_models;
  ExpectedResidual expected(hierarchy, references);
  for (const uint32_t v : hierarchy.order()) {
    predictor.move_to(v, state.positions);
    expected.move_to(v, state.residuals);
    for (size_t axis = 0; axis < 3; ++axis) {
      int32_t& position = state.positions[v][axis];
      const int32_t predicted = predictor.predict(axis, coefficients[level_class(hierarchy, v)]);
      IntegerModel& model = state.position_models.of(expected.next(axis));
      const int residual = model.code(coder, position - predicted);
      position = predicted + residual;
      if (std::abs(position) > kMaxLattice) return false;
      state.laplacians[v][axis] = predictor.laplacian(axis, position);
      expected.add(residual);
    }
    state.residuals[v] = expected.sum();
    if constexpr (requires { coder.overran(); }) {
      if (coder.overran()) return false;
    }
  }
  return true;
}

}  // namespace v3d::codec
