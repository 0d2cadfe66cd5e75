#include "calib/lens/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <utility>

#include "calib/lens/reprojection_residual.h"

namespace v3d::calib {
namespace {

using LensBlock = std::array<double, kMostLensSize>;
using PoseBlock = std::array<double, kPoseSize>;

LensBlock lens_block(const CameraModel& camera) {
  const Eigen::Matrix3d& k = camera.matrix();
  LensBlock block = {k(0, 0), k(1, 1), k(0, 2), k(1, 2)};
  std::copy_n(camera.distortion().begin(), kMostLensSize - 4, block.begin() + 4);
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
  std::copy_n(lens.begin() + 4, kMostLensSize - 4, distortion.begin());
  return {before.size(), k, distortion, transform_of(pose)};
}

/// All that one camera saw of one board, as Ceres asks for it: corner by corner, its own work for
/// each residual block took longer than the corners.
class SightingCost final : public ceres::CostFunction {
 public:
  explicit SightingCost(SightingMiss sighting) : sighting_(std::move(sighting)) {
    set_num_residuals(sighting_.rows());
    *mutable_parameter_block_sizes() = {kPoseSize, kPoseSize};
    if (sighting_.lens_size() > 0) {
      mutable_parameter_block_sizes()->push_back(sighting_.lens_size());
    }
  }

  bool Evaluate(double const* const* blocks, double* miss, double** slopes) const override {
    return sighting_.evaluate(blocks, miss, slopes);
  }

 private:
  SightingMiss sighting_;
};

/// What lenses are like, where the sightings do not say: square pixels, the axis near the middle,
/// little distortion. Weighs as much as a corner or two, and less than any board that reaches the
/// place in question.
class UsualLens {
 public:
  UsualLens(const CameraModel& camera, int coefficients)
      : middle_x_(0.5 * (camera.size().width - 1)),
        middle_y_(0.5 * (camera.size().height - 1)),
        coefficients_(coefficients) {}

  static ceres::CostFunction* cost(const CameraModel& camera, int coefficients) {
    auto cost = std::make_unique<ceres::DynamicAutoDiffCostFunction<UsualLens>>(
        new UsualLens(camera, coefficients));
    cost->AddParameterBlock(4 + coefficients);
    cost->SetNumResiduals(3 + coefficients);
    return cost.release();
  }

  template <class T>
  bool operator()(const T* const* blocks, T* miss) const {
    constexpr double kCornerPx = 0.3;  // what a corner is good for
    constexpr double kUsual[] = {0.3, 0.3, 0.002, 0.002, 0.3, 0.3, 0.3, 0.3};
    const T* lens = blocks[0];
    miss[0] = kCornerPx / 0.003 * (lens[0] - lens[1]) / (lens[0] + lens[1]);
    miss[1] = kCornerPx / (0.04 * middle_x_) * (lens[2] - middle_x_);
    miss[2] = kCornerPx / (0.04 * middle_x_) * (lens[3] - middle_y_);
    for (int i = 0; i < coefficients_; ++i) miss[3 + i] = kCornerPx / kUsual[i] * lens[4 + i];
    return true;
  }

 private:
  double middle_x_, middle_y_;
  int coefficients_;
};

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
    add_points();
    add_usual_lenses();
    for (const int camera : options.fixed_cameras) {
      problem_.SetParameterBlockConstant(poses_[camera].data());
    }
  }

  BundleSummary solve() {
    ceres::Solver::Options how;
    how.linear_solver_type = ceres::SPARSE_SCHUR;
    how.max_num_iterations = options_.iterations;
    how.num_threads = options_.threads;
    how.function_tolerance = 1e-9;
    how.parameter_tolerance = 1e-10;
    how.logging_type = ceres::SILENT;
    how.linear_solver_ordering = boards_first();
    ceres::Solver::Summary summary;
    ceres::Solve(how, &problem_, &summary);
    write_back();
    return {summary.termination_type == ceres::CONVERGENCE, summary.num_successful_steps,
            summary.message};
  }

 private:
  /// Of the lens of a camera.
  int free_coefficients(int camera) const {
    return options_.coefficients.empty() ? 0 : options_.coefficients[camera];
  }

  void add_points() {
    std::map<std::pair<int, int>, SightingMiss> sightings;
    for (const BundlePoint& point : bundle_.points) {
      const auto [sighting, is_new] =
          sightings.try_emplace({point.board, point.camera}, bundle_.cameras[point.camera],
                                free_coefficients(point.camera), options_.robust_px);
      sighting->second.add(bundle_.board.corner(point.corner), point.pixel);
    }
    for (auto& [key, sighting] : sightings) {
      const auto [board, camera] = key;
      std::vector<double*> blocks = {poses_[camera].data(), boards_[board].data()};
      if (sighting.lens_size() > 0) blocks.push_back(lenses_[camera].data());
      problem_.AddResidualBlock(new SightingCost(std::move(sighting)), nullptr, blocks);
    }
  }

  void add_usual_lenses() {
    for (size_t i = 0; i < lenses_.size(); ++i) {
      const int free = free_coefficients(static_cast<int>(i));
      if (free == 0) continue;
      problem_.AddResidualBlock(UsualLens::cost(bundle_.cameras[i], free), nullptr,
                                lenses_[i].data());
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
  ceres::Problem problem_;  // owns the costs and losses it is given
};

}  // namespace

BundleSummary adjust(Bundle& bundle, const BundleOptions& options) {
  return Solver(bundle, options).solve();
}

std::vector<Eigen::Vector2d> misses(const Bundle& bundle) {
  std::vector<Eigen::Vector2d> result;
  result.reserve(bundle.points.size());
  for (const BundlePoint& point : bundle.points) {
    const auto pixel = bundle.cameras[point.camera].project(bundle.world_from_board[point.board] *
                                                            bundle.board.corner(point.corner));
    result.push_back(pixel ? point.pixel - *pixel : Eigen::Vector2d(1e6, 1e6));
  }
  return result;
}

}  // namespace v3d::calib
