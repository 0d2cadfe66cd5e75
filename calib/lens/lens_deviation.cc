#include "calib/lens/lens_deviation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/lens/lens_prior.h"
#include "calib/lens/reprojection_residual.h"

namespace v3d::calib {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::array<double, kMaxLensSize> lens_block(const CameraModel& lens) {
  const Eigen::Matrix3d& k = lens.matrix();
  std::array<double, kMaxLensSize> block = {k(0, 0), k(1, 1), k(0, 2), k(1, 2)};
  std::copy_n(lens.distortion().begin(), kMaxLensSize - 4, block.begin() + 4);
  return block;
}

/// What the corners of all views say about the lens.
struct LensInformation {
  Eigen::MatrixXd normal;    ///< lens x lens, without the share that board poses can explain
  Eigen::VectorXd gradient;  ///< the same
  double loss = 0;           ///< pixels squared
  int corners = 0;
  bool valid = true;  ///< no corner is behind the camera
};

void add_view(const CameraModel& lens, int coefficients, const Board& board,
              const PosedObservation& view, double robust_px, LensInformation& information) {
  ReprojectionResidual residual(lens, coefficients, robust_px);
  for (int i = 0; i < view.observation->count(); ++i) {
    residual.add(board.corner(view.observation->corners[i]), view.observation->pixels[i]);
  }
  const std::array<double, kPoseSize> camera{};
  const Eigen::Vector3d turn = view.cam_from_board.rodrigues();
  const Eigen::Vector3d& place = view.cam_from_board.translation;
  const std::array<double, kPoseSize> pose = {turn.x(),  turn.y(),  turn.z(),
                                              place.x(), place.y(), place.z()};
  const std::array<double, kMaxLensSize> values = lens_block(lens);
  const double* const blocks[] = {camera.data(), pose.data(), values.data()};
  Eigen::VectorXd residuals(residual.rows());
  Rows wrt_board(residual.rows(), kPoseSize), wrt_lens(residual.rows(), residual.lens_size());
  double* jacobians[] = {nullptr, wrt_board.data(), wrt_lens.data()};
  information.valid &= residual.evaluate(blocks, residuals.data(), jacobians);
  if (!information.valid) return;
  // Rows beyond the sixth do not change when the board moves.
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(wrt_board);
  const Eigen::MatrixXd rotated = qr.householderQ().adjoint() * Eigen::MatrixXd(wrt_lens);
  const Eigen::MatrixXd without_board = rotated.bottomRows(rotated.rows() - kPoseSize);
  const Eigen::VectorXd rotated_residuals = qr.householderQ().adjoint() * residuals;
  information.normal += without_board.transpose() * without_board;
  information.gradient +=
      without_board.transpose() * rotated_residuals.tail(rotated.rows() - kPoseSize);
  information.loss += residuals.squaredNorm();
  information.corners += view.observation->count();
}

/// The same of the prior.
LensInformation prior_information(const CameraModel& lens, int coefficients) {
  const LensPrior prior(lens, coefficients);
  const std::array<double, kMaxLensSize> values = lens_block(lens);
  const double* const blocks[] = {values.data()};
  Eigen::VectorXd residuals(prior.rows());
  prior(blocks, residuals.data());
  const Eigen::MatrixXd rows = prior.jacobian(values[0], values[1]);
  return {rows.transpose() * rows, rows.transpose() * residuals};
}

/// The inverse of a symmetric, positive semidefinite matrix with a positive diagonal. A direction
/// of which it contains only rounding errors gets a large, finite value.
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& normal) {
  constexpr double kRounding = 1e-12;  // above that of ReprojectionResidual
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const Eigen::VectorXd inverse = eigen.eigenvalues().cwiseMax(kRounding).cwiseInverse();
  const Eigen::MatrixXd directions = scale.asDiagonal() * eigen.eigenvectors();
  return directions * inverse.asDiagonal() * directions.transpose();
}

}  // namespace

double focal_deviation_px(const CameraModel& lens, int coefficients, const Board& board,
                          std::span<const PosedObservation> views, double robust_px) {
  const int size = 4 + coefficients;
  LensInformation seen{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  for (const PosedObservation& view : views) {
    add_view(lens, coefficients, board, view, robust_px, seen);
  }
  if (!seen.valid) return std::numeric_limits<double>::infinity();
  const int freedom = 2 * seen.corners - kPoseSize * static_cast<int>(views.size()) - size;
  const double corner_variance = seen.loss / std::max(1, freedom);
  const LensInformation prior = prior_information(lens, coefficients);
  // The adjustment weighs corners and prior as if both had kCornerPx. Their true deviations differ,
  // so the covariance is not simply a multiple of the inverse.
  const Eigen::MatrixXd inverse = inverse_of(seen.normal + prior.normal);
  const Eigen::MatrixXd scatter =
      corner_variance * seen.normal + LensPrior::kCornerPx * LensPrior::kCornerPx * prior.normal;
  const Eigen::MatrixXd covariance = inverse * scatter * inverse;
  const double deviation = std::sqrt(std::max(0.0, covariance(0, 0)));
  // In a flat valley the adjustment can end before its minimum.
  const Eigen::VectorXd to_minimum = inverse * (seen.gradient + prior.gradient);
  return std::hypot(deviation, to_minimum[0]);
}

}  // namespace v3d::calib
