#include "calib/bundle.h"

#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>

namespace v3d::calib {
namespace {

// A lens: fx fy cx cy, then k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4. A pose: rotation vector,
// translation.
constexpr int kLensSize = 16;
constexpr int kPoseSize = 6;
using LensBlock = std::array<double, kLensSize>;
using PoseBlock = std::array<double, kPoseSize>;

LensBlock lens_block(const CameraModel& camera) {
  const Eigen::Matrix3d& k = camera.matrix();
  LensBlock block = {k(0, 0), k(1, 1), k(0, 2), k(1, 2)};
  std::copy_n(camera.distortion().begin(), kLensSize - 4, block.begin() + 4);
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
  std::copy_n(lens.begin() + 4, kLensSize - 4, distortion.begin());
  return {before.size(), k, distortion, transform_of(pose)};
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// A rotation vector's matrix, and how a rotated point moves with the vector.
class Turn {
 public:
  explicit Turn(const double* vector) : vector_(vector[0], vector[1], vector[2]) {
    const double angle = vector_.norm();
    const Eigen::Vector3d axis =
        angle > 0 ? Eigen::Vector3d(vector_ / angle) : Eigen::Vector3d::UnitX().eval();
    matrix_ = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    // The left Jacobian of SO(3) (Barfoot 2017, eq. 7.77b).
    if (angle > 1e-8) {
      const double s = std::sin(angle) / angle, c = (1 - std::cos(angle)) / angle;
      left_ = s * Eigen::Matrix3d::Identity() + (1 - s) * axis * axis.transpose() +
              c * cross_matrix(axis);
    }
  }
  bool is_of(const double* vector) const {
    return vector_ == Eigen::Map<const Eigen::Vector3d>(vector);
  }
  const Eigen::Matrix3d& matrix() const { return matrix_; }
  /// By the vector, of the point that was turned to `turned`.
  Eigen::Matrix3d slope(const Eigen::Vector3d& turned) const {
    return -cross_matrix(turned) * left_;
  }

 private:
  Eigen::Vector3d vector_;
  Eigen::Matrix3d matrix_;
  Eigen::Matrix3d left_ = Eigen::Matrix3d::Identity();
};

/// The turn of a vector that is mostly the one of the call before: one camera sees all corners of a
/// board before another is asked.
class LastTurn {
 public:
  const Turn& of(const double* vector) {
    if (!turn_.is_of(vector)) turn_ = Turn(vector);
    return turn_;
  }

 private:
  static constexpr double kNone[3] = {};
  Turn turn_{kNone};
};

using Slopes = Eigen::Matrix<double, 2, 12>;

/// The lens model of base/camera_model.h with its slopes.
struct Bent {
  Eigen::Vector2d at;
  Eigen::Matrix2d by_point;
  Slopes by_coefficient;
};

Bent bend(const double* d, double x, double y) {
  const double s = x * x + y * y, s2 = s * s, s3 = s2 * s;
  const double bottom = 1 + d[5] * s + d[6] * s2 + d[7] * s3;
  const double radial = (1 + d[0] * s + d[1] * s2 + d[4] * s3) / bottom;
  const double slope =
      ((d[0] + 2 * d[1] * s + 3 * d[4] * s2) - radial * (d[5] + 2 * d[6] * s + 3 * d[7] * s2)) /
      bottom;  // of the radial factor, by s
  const double xy = 2 * x * y, xx = s + 2 * x * x, yy = s + 2 * y * y;
  Bent bent;
  bent.at << x * radial + d[2] * xy + d[3] * xx + d[8] * s + d[9] * s2,
      y * radial + d[2] * yy + d[3] * xy + d[10] * s + d[11] * s2;
  const double prism_x = d[8] + 2 * d[9] * s, prism_y = d[10] + 2 * d[11] * s;
  bent.by_point << radial + 2 * x * x * slope + 2 * d[2] * y + 6 * d[3] * x + 2 * x * prism_x,
      xy * slope + 2 * d[2] * x + 2 * d[3] * y + 2 * y * prism_x,
      xy * slope + 2 * d[2] * x + 2 * d[3] * y + 2 * x * prism_y,
      radial + 2 * y * y * slope + 6 * d[2] * y + 2 * d[3] * x + 2 * y * prism_y;
  const Eigen::Vector2d p(x, y);
  const double top = 1 / bottom, low = -radial / bottom;
  bent.by_coefficient << p * top * s, p * top * s2, Eigen::Vector2d(xy, yy),
      Eigen::Vector2d(xx, xy), p * top * s3, p * low * s, p * low * s2, p * low * s3,
      Eigen::Vector2d(s, 0), Eigen::Vector2d(s2, 0), Eigen::Vector2d(0, s), Eigen::Vector2d(0, s2);
  return bent;
}

/// CameraModel::project() less the pixel, with its slopes: written out, because a bundle has
/// hundreds of thousands of corners and automatic derivatives take twenty times as long.
class CornerMiss final : public ceres::SizedCostFunction<2, kLensSize, kPoseSize, kPoseSize> {
 public:
  CornerMiss(const CameraModel& camera, const Eigen::Vector3d& corner, const Eigen::Vector2d& pixel)
      : skew_(camera.matrix()(0, 1)), tilt_(camera.tilt()), corner_(corner), pixel_(pixel) {}

  bool Evaluate(double const* const* blocks, double* miss, double** slopes) const override {
    const double* lens = blocks[0];
    thread_local LastTurn last_camera, last_board;
    const Turn& camera = last_camera.of(blocks[1]);
    const Turn& board = last_board.of(blocks[2]);
    const Eigen::Vector3d turned_corner = board.matrix() * corner_;
    const Eigen::Vector3d world = turned_corner + Eigen::Map<const Eigen::Vector3d>(blocks[2] + 3);
    const Eigen::Vector3d turned_world = camera.matrix() * world;
    const Eigen::Vector3d p = turned_world + Eigen::Map<const Eigen::Vector3d>(blocks[1] + 3);
    if (!(p.z() > 1e-6)) return false;
    Bent bent = bend(lens + 4, p.x() / p.z(), p.y() / p.z());
    lean(bent);
    miss[0] = lens[0] * bent.at.x() + skew_ * bent.at.y() + lens[2] - pixel_.x();
    miss[1] = lens[1] * bent.at.y() + lens[3] - pixel_.y();
    if (!slopes) return true;
    Eigen::Matrix2d scale;
    scale << lens[0], skew_, 0, lens[1];
    if (slopes[0]) {
      Eigen::Map<Eigen::Matrix<double, 2, kLensSize, Eigen::RowMajor>> by_lens(slopes[0]);
      by_lens.leftCols<4>() << bent.at.x(), 0, 1, 0, 0, bent.at.y(), 0, 1;
      by_lens.rightCols<12>() = scale * bent.by_coefficient;
    }
    Eigen::Matrix<double, 2, 3> flatten;
    flatten << 1 / p.z(), 0, -p.x() / (p.z() * p.z()), 0, 1 / p.z(), -p.y() / (p.z() * p.z());
    const Eigen::Matrix<double, 2, 3> by_p = scale * bent.by_point * flatten;
    if (slopes[1]) put(by_p, camera.slope(turned_world), slopes[1]);
    if (slopes[2]) put(by_p * camera.matrix(), board.slope(turned_corner), slopes[2]);
    return true;
  }

 private:
  static void put(const Eigen::Matrix<double, 2, 3>& by_translation, const Eigen::Matrix3d& turn,
                  double* slopes) {
    Eigen::Map<Eigen::Matrix<double, 2, kPoseSize, Eigen::RowMajor>> by_pose(slopes);
    by_pose.leftCols<3>() = by_translation * turn;
    by_pose.rightCols<3>() = by_translation;
  }

  /// The tilted sensor; nothing for most.
  void lean(Bent& bent) const {
    if (tilt_.isIdentity(0)) return;
    const Eigen::Vector3d q = tilt_ * bent.at.homogeneous();
    bent.at = q.head<2>() / q.z();
    const Eigen::Matrix2d slope =
        (tilt_.topLeftCorner<2, 2>() - bent.at * tilt_.block<1, 2>(2, 0)) / q.z();
    bent.by_point = slope * bent.by_point;
    bent.by_coefficient = slope * bent.by_coefficient;
  }

  double skew_;
  Eigen::Matrix3d tilt_;
  Eigen::Vector3d corner_;
  Eigen::Vector2d pixel_;
};

/// What lenses are like, where the sightings do not say: square pixels, the axis near the middle,
/// little distortion. Weighs as much as a corner or two, and less than any board that reaches the
/// place in question.
class UsualLens {
 public:
  explicit UsualLens(const CameraModel& camera)
      : middle_x_(0.5 * (camera.size().width - 1)), middle_y_(0.5 * (camera.size().height - 1)) {}

  template <class T>
  bool operator()(const T* lens, T* miss) const {
    constexpr double kCornerPx = 0.3;  // what a corner is good for
    constexpr double kUsual[] = {0.3, 0.3, 0.002, 0.002, 0.3, 0.3, 0.3, 0.3};
    miss[0] = kCornerPx / 0.003 * (lens[0] - lens[1]) / (lens[0] + lens[1]);
    miss[1] = kCornerPx / (0.04 * middle_x_) * (lens[2] - middle_x_);
    miss[2] = kCornerPx / (0.04 * middle_x_) * (lens[3] - middle_y_);
    for (int i = 0; i < 8; ++i) miss[3 + i] = kCornerPx / kUsual[i] * lens[4 + i];
    return true;
  }

 private:
  double middle_x_, middle_y_;
};

using LensCost = ceres::AutoDiffCostFunction<UsualLens, 11, kLensSize>;

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
    hold_what_is_known();
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
  void add_points() {
    for (const BundlePoint& point : bundle_.points) {
      const CameraModel& camera = bundle_.cameras[point.camera];
      problem_.AddResidualBlock(
          new CornerMiss(camera, bundle_.board.corner(point.corner), point.pixel),
          new ceres::HuberLoss(options_.robust_px), lenses_[point.camera].data(),
          poses_[point.camera].data(), boards_[point.board].data());
    }
  }

  void hold_what_is_known() {
    for (size_t i = 0; i < lenses_.size(); ++i) {
      const int free = options_.coefficients.empty() ? 0 : options_.coefficients[i];
      if (free == 0) {
        problem_.SetParameterBlockConstant(lenses_[i].data());
        continue;
      }
      std::vector<int> held(kLensSize - 4 - free);
      std::iota(held.begin(), held.end(), 4 + free);
      problem_.SetManifold(lenses_[i].data(), new ceres::SubsetManifold(kLensSize, held));
      problem_.AddResidualBlock(new LensCost(new UsualLens(bundle_.cameras[i])), nullptr,
                                lenses_[i].data());
    }
    for (const int camera : options_.fixed_cameras) {
      problem_.SetParameterBlockConstant(poses_[camera].data());
    }
  }

  std::shared_ptr<ceres::ParameterBlockOrdering> boards_first() {
    auto order = std::make_shared<ceres::ParameterBlockOrdering>();
    for (PoseBlock& board : boards_) order->AddElementToGroup(board.data(), 0);
    for (PoseBlock& pose : poses_) order->AddElementToGroup(pose.data(), 1);
    for (LensBlock& lens : lenses_) order->AddElementToGroup(lens.data(), 1);
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
