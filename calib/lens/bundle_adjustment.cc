#include "calib/lens/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <utility>

#include "calib/lens/lens_prior.h"
#include "calib/lens/reprojection_residual.h"

namespace v3d::calib {
namespace {

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

}  // namespace v3d::calib
