#include "calib/lens/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "base/geometry/camera_model.h"
#include "calib/lens/reprojection_residual.h"

namespace v3d::calib {
namespace {

/// A weak prior for lenses: square pixels, principal point near the middle, little distortion.
/// It weighs as much as one or two corners, so any board in an image region outweighs it.
///
/// Parameters: the lens block of reprojection_residual.h. A residual is kCornerPx where its
/// parameter differs from the expected one by one standard deviation of the prior.
class LensPrior {
 public:
  static constexpr double kCornerPx = 0.3;  ///< standard deviation of a detected corner

  /// `coefficients`: number of free distortion coefficients.
  LensPrior(const CameraModel& camera, int coefficients)
      : middle_x_(0.5 * (camera.size().width - 1)),
        middle_y_(0.5 * (camera.size().height - 1)),
        coefficients_(coefficients) {}

  int rows() const { return 3 + coefficients_; }

  /// A functor of Ceres; `blocks`: one lens block.
  template <class T>
  bool operator()(const T* const* blocks, T* residuals) const {
    const T* lens = blocks[0];
    residuals[0] = kPixelWeight * (lens[0] - lens[1]) / (lens[0] + lens[1]);
    residuals[1] = middle_weight() * (lens[2] - middle_x_);
    residuals[2] = middle_weight() * (lens[3] - middle_y_);
    for (int i = 0; i < coefficients_; ++i) residuals[3 + i] = kCornerPx / kStdDev[i] * lens[4 + i];
    return true;
  }

  /// Derivatives of the residuals by the lens block, rows() x (4 + coefficients).
  Eigen::MatrixXd jacobian(double fx, double fy) const {
    Eigen::MatrixXd rows_by_lens = Eigen::MatrixXd::Zero(rows(), 4 + coefficients_);
    const double sum_squared = (fx + fy) * (fx + fy);
    rows_by_lens(0, 0) = kPixelWeight * 2 * fy / sum_squared;
    rows_by_lens(0, 1) = -kPixelWeight * 2 * fx / sum_squared;
    rows_by_lens(1, 2) = rows_by_lens(2, 3) = middle_weight();
    for (int i = 0; i < coefficients_; ++i) rows_by_lens(3 + i, 4 + i) = kCornerPx / kStdDev[i];
    return rows_by_lens;
  }

 private:
  static constexpr double kPixelWeight = kCornerPx / 0.003;
  static constexpr double kStdDev[] = {0.3, 0.3, 0.002, 0.002, 0.3, 0.3, 0.3, 0.3};

  double middle_weight() const { return kCornerPx / (0.04 * middle_x_); }

  double middle_x_, middle_y_;
  int coefficients_;
};

using LensBlock = std::array<double, kMaxLensSize>;
using PoseBlock = std::array<double, kPoseSize>;

LensBlock lens_block(const CameraModel& camera) {
  const Eigen::Matrix3d& k = camera.matrix();
  LensBlock block = {k(0, 0), k(1, 1), k(0, 2), k(1, 2)};
  std::copy_n(camera.distortion().begin(), kMaxLensSize - 4, block.begin() + 4);
  return block;
}

PoseBlock pose_block(const RigidTransform& t) {
  const Eigen::Vector3d r = t.rodrigues();
  return {r.x(), r.y(), r.z(), t.translation.x(), t.translation.y(), t.translation.z()};
}

RigidTransform transform_of(const PoseBlock& p) {
  return RigidTransform::from_rodrigues({p[0], p[1], p[2]}, {p[3], p[4], p[5]});
}

CameraModel camera_of(const CameraModel& before, const LensBlock& lens, const PoseBlock& pose) {
  Eigen::Matrix3d k = before.matrix();
  k(0, 0) = lens[0];
  k(1, 1) = lens[1];
  k(0, 2) = lens[2];
  k(1, 2) = lens[3];
  Distortion distortion = before.distortion();
  std::copy_n(lens.begin() + 4, kMaxLensSize - 4, distortion.begin());
  return {before.size(), k, distortion, transform_of(pose)};
}

/// One residual block for all corners of one board in one camera. With one block per corner, Ceres'
/// overhead per block exceeds the cost of the corners.
class ReprojectionCost final : public ceres::CostFunction {
 public:
  explicit ReprojectionCost(ReprojectionResidual residual) : residual_(std::move(residual)) {
    set_num_residuals(residual_.rows());
    *mutable_parameter_block_sizes() = {kPoseSize, kPoseSize};
    if (residual_.lens_size() > 0)
      mutable_parameter_block_sizes()->push_back(residual_.lens_size());
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    return residual_.evaluate(blocks, residuals, jacobians);
  }

 private:
  ReprojectionResidual residual_;
};

ceres::CostFunction* prior_cost(const CameraModel& camera, int coefficients) {
  auto cost = std::make_unique<ceres::DynamicAutoDiffCostFunction<LensPrior>>(
      new LensPrior(camera, coefficients));
  cost->AddParameterBlock(4 + coefficients);
  cost->SetNumResiduals(LensPrior(camera, coefficients).rows());
  return cost.release();
}

class Solver {
 public:
  Solver(Bundle& bundle, const BundleOptions& options) : bundle_(bundle), options_(options) {
    for (const CameraModel& camera : bundle.cameras) {
      lenses_.push_back(lens_block(camera));
      poses_.push_back(pose_block(camera.cam_from_world()));
    }
    for (const RigidTransform& board : bundle.world_from_board) {
      boards_.push_back(pose_block(board));
    }
    add_observations();
    add_lens_priors();
    for (const int camera : options.fixed_cameras) {
      problem_.SetParameterBlockConstant(poses_[camera].data());
    }
  }

  BundleSummary solve() {
    ceres::Solver::Options solver_options;
    solver_options.linear_solver_type = ceres::SPARSE_SCHUR;
    solver_options.max_num_iterations = options_.iterations;
    solver_options.num_threads = options_.threads;
    solver_options.function_tolerance = 1e-9;
    solver_options.parameter_tolerance = 1e-10;
    solver_options.logging_type = ceres::SILENT;
    solver_options.linear_solver_ordering = boards_first();
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem_, &summary);
    write_back();
    return {summary.termination_type == ceres::CONVERGENCE, summary.num_successful_steps,
            summary.message};
  }

 private:
  /// Number of free coefficients of the lens of a camera.
  int free_coefficients(int camera) const {
    return options_.coefficients.empty() ? 0 : options_.coefficients[camera];
  }

  void add_observations() {
    std::map<std::pair<int, int>, ReprojectionResidual> residuals;
    for (const CornerObservation& observation : bundle_.observations) {
      const auto [residual, is_new] = residuals.try_emplace(
          {observation.board, observation.camera}, bundle_.cameras[observation.camera],
          free_coefficients(observation.camera), options_.robust_px);
      residual->second.add(bundle_.board.corner(observation.corner), observation.pixel);
    }
    for (auto& [key, residual] : residuals) {
      const auto [board, camera] = key;
      std::vector<double*> blocks = {poses_[camera].data(), boards_[board].data()};
      if (residual.lens_size() > 0) blocks.push_back(lenses_[camera].data());
      problem_.AddResidualBlock(new ReprojectionCost(std::move(residual)), nullptr, blocks);
    }
  }

  void add_lens_priors() {
    for (size_t i = 0; i < lenses_.size(); ++i) {
      const int free = free_coefficients(static_cast<int>(i));
      if (free == 0) continue;
      problem_.AddResidualBlock(prior_cost(bundle_.cameras[i], free), nullptr, lenses_[i].data());
    }
  }

  std::shared_ptr<ceres::ParameterBlockOrdering> boards_first() {
    auto order = std::make_shared<ceres::ParameterBlockOrdering>();
    for (PoseBlock& board : boards_) order->AddElementToGroup(board.data(), 0);
    for (PoseBlock& pose : poses_) order->AddElementToGroup(pose.data(), 1);
    for (size_t i = 0; i < lenses_.size(); ++i) {
      if (free_coefficients(static_cast<int>(i)) > 0)
        order->AddElementToGroup(lenses_[i].data(), 1);
    }
    return order;
  }

  void write_back() {
    for (size_t i = 0; i < poses_.size(); ++i) {
      bundle_.cameras[i] = camera_of(bundle_.cameras[i], lenses_[i], poses_[i]);
    }
    for (size_t i = 0; i < boards_.size(); ++i) {
      bundle_.world_from_board[i] = transform_of(boards_[i]);
    }
  }

  Bundle& bundle_;
  const BundleOptions& options_;
  std::vector<LensBlock> lenses_;
  std::vector<PoseBlock> poses_;
  std::vector<PoseBlock> boards_;
  ceres::Problem problem_;  // owns the cost functions
};

}  // namespace

BundleSummary adjust(Bundle& bundle, const BundleOptions& options) {
  return Solver(bundle, options).solve();
}

std::vector<Eigen::Vector2d> residuals(const Bundle& bundle) {
  std::vector<Eigen::Vector2d> result;
  result.reserve(bundle.observations.size());
  for (const CornerObservation& observation : bundle.observations) {
    const auto pixel = bundle.cameras[observation.camera].project(
        bundle.world_from_board[observation.board] * bundle.board.corner(observation.corner));
    result.push_back(pixel ? observation.pixel - *pixel : Eigen::Vector2d(1e6, 1e6));
  }
  return result;
}

namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

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
