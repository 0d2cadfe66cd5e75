// Encoder of positions: fits the coefficients of the prediction.
#include <algorithm>
#include <cmath>

#include "codec/check.h"
#include "codec/motion_positions.h"

namespace v3d::codec {
namespace {

constexpr size_t kMaxCoefficients = 2 * kMaxReferences;
constexpr double kOne = 1 << kCoefficientBits;

/// Weighted least squares of a few coefficients.
class LeastSquares {
 public:
  explicit LeastSquares(size_t coefficients) : size_(coefficients) {}

  void add(const PositionPredictor& predictor, size_t axis, double target, double weight) {
    for (size_t i = 0; i < size_; ++i) {
      const double scaled = weight * predictor.feature(i, axis);
      for (size_t j = 0; j <= i; ++j) matrix_[i][j] += scaled * predictor.feature(j, axis);
      right_[i] += scaled * target;
    }
  }

  /// By the decomposition of Cholesky. Coefficients that nothing determines are 0.
  std::array<double, kMaxCoefficients> solve() {
    constexpr double kRidge = 1e-7, kFloor = 1e-9;
    std::array<double, kMaxCoefficients> x{};
    for (size_t i = 0; i < size_; ++i) matrix_[i][i] += kRidge * matrix_[i][i] + kFloor;
    for (size_t i = 0; i < size_; ++i) {
      for (size_t j = 0; j < i; ++j) matrix_[i][j] = rest(i, j) / matrix_[j][j];
      matrix_[i][i] = std::sqrt(std::max(rest(i, i), kFloor));
      double sum = right_[i];
      for (size_t k = 0; k < i; ++k) sum -= matrix_[i][k] * x[k];
      x[i] = sum / matrix_[i][i];
    }
    for (size_t i = size_; i-- > 0;) {
      for (size_t k = i + 1; k < size_; ++k) x[i] -= matrix_[k][i] * x[k];
      x[i] /= matrix_[i][i];
    }
    return x;
  }

 private:
  double rest(size_t i, size_t j) const {
    double sum = matrix_[i][j];
    for (size_t k = 0; k < j; ++k) sum -= matrix_[i][k] * matrix_[j][k];
    return sum;
  }

  size_t size_;
  std::array<std::array<double, kMaxCoefficients>, kMaxCoefficients> matrix_{};
  std::array<double, kMaxCoefficients> right_{};
};

/// Residual of the prediction, 1/16 step.
double error_of(const PositionPredictor& predictor, size_t axis, double target,
                const PredictionCoefficients& coefficients) {
  for (size_t f = 0; f < predictor.features(); ++f) {
    target -= coefficients[f] / kOne * predictor.feature(f, axis);
  }
  return target;
}

/// Least squares, weighted by the residuals of `before` (iteratively reweighted least squares).
PulseCoefficients refit(const VertexHierarchy& hierarchy, References references,
                        std::span<const LatticePosition> positions,
                        const PulseCoefficients* before) {
  constexpr double kSoftening = 8;  // 1/16 step: half a step
  PositionPredictor predictor(hierarchy, references);
  std::vector<LeastSquares> systems(kLevelClasses, LeastSquares(predictor.features()));
  for (const uint32_t v : hierarchy.order()) {
    predictor.move_to(v, positions);
    const size_t c = level_class(hierarchy, v);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double target = predictor.laplacian(axis, positions[v][axis]);
      const double weight =
          before == nullptr
              ? 1
              : 1 / (std::abs(error_of(predictor, axis, target, (*before)[c])) + kSoftening);
      systems[c].add(predictor, axis, target, weight);
    }
  }
  PulseCoefficients fitted{};
  for (size_t c = 0; c < kLevelClasses; ++c) {
    const auto solved = systems[c].solve();
    for (size_t f = 0; f < predictor.features(); ++f) {
      fitted[c][f] =
          static_cast<int16_t>(std::clamp(std::round(kOne * solved[f]), -32767., 32767.));
    }
  }
  return fitted;
}

/// The coefficients with about the least sum of absolute residuals.
PulseCoefficients fit_coefficients(const VertexHierarchy& hierarchy, References references,
                                   std::span<const LatticePosition> positions) {
  if (references.empty()) return {};
  PulseCoefficients fitted = refit(hierarchy, references, positions, nullptr);
  for (int pass = 0; pass < 3; ++pass) {
    fitted = refit(hierarchy, references, positions, &fitted);
  }
  return fitted;
}

}  // namespace

std::vector<uint8_t> encode_positions(const VertexHierarchy& hierarchy, References references,
                                      PulseState& state) {
  RangeEncoder coder;
  const auto coefficients = fit_coefficients(hierarchy, references, state.positions);
  V3D_CODEC_CHECK(code_positions(coder, hierarchy, references, coefficients, state));
  return coder.take();
}

}  // namespace v3d::codec
