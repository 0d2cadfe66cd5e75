// Linear prediction of the position of a vertex from its coarse neighbours and other pulses.
#pragma once

#include <array>
#include <cstdint>
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

}  // namespace v3d::codec
