#include "calib/lens/reprojection_residual.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/boards/board.h"

namespace v3d::calib {
namespace {

constexpr double kRobustPx = 1.5;

/// A skewed, tilted camera with all coefficients, and its observation of a board. The corners are
/// off by 0.8 px, one of them by 20 px.
class ReprojectionResiduals : public testing::TestWithParam<int> {
 protected:
  ReprojectionResiduals() : residual_(camera_, GetParam(), kRobustPx) {
    const CameraModel camera = camera_at(blocks_);
    for (int i = 0; i < board_.corners(); ++i) {
      const Eigen::Vector2d off(std::sin(5.0 * i), std::cos(3.0 * i));
      pixels_.push_back(projected(camera, blocks_, i) + (i == 7 ? 20 : 0.8) * off);
      residual_.add(board_.corner(i), pixels_.back());
    }
  }

  int lens_size() const { return GetParam() == 0 ? 0 : 4 + GetParam(); }
  int columns() const { return 2 * kPoseSize + lens_size(); }

  /// `blocks`: camera pose, board pose, free lens values.
  CameraModel camera_at(const Eigen::VectorXd& blocks) const {
    Eigen::Matrix3d k = camera_.matrix();
    Distortion distortion = camera_.distortion();
    if (lens_size() > 0) {
      k(0, 0) = blocks[12];
      k(1, 1) = blocks[13];
      k(0, 2) = blocks[14];
      k(1, 2) = blocks[15];
      std::copy_n(blocks.data() + 16, GetParam(), distortion.begin());
    }
    return {camera_.size(), k, distortion, pose(blocks.head<6>())};
  }
  static RigidTransform pose(const Eigen::Matrix<double, 6, 1>& block) {
    return RigidTransform::from_rodrigues(block.head<3>(), block.tail<3>());
  }
  Eigen::Vector2d projected(const CameraModel& camera, const Eigen::VectorXd& blocks,
                            int corner) const {
    return *camera.project(pose(blocks.segment<6>(6)) * board_.corner(corner));
  }
  Eigen::VectorXd residuals_at(const Eigen::VectorXd& blocks) const {
    const CameraModel camera = camera_at(blocks);
    Eigen::VectorXd all(2 * board_.corners());
    for (int i = 0; i < board_.corners(); ++i) {
      all.segment<2>(2 * i) = projected(camera, blocks, i) - pixels_[i];
    }
    return all;
  }

  /// Residuals by corner with their numerical derivatives, weighted by Huber's loss.
  Eigen::MatrixXd weighted_rows() const {
    Eigen::MatrixXd rows(2 * board_.corners(), columns() + 1);
    for (int c = 0; c < columns(); ++c) {
      const double step = 1e-6 * std::max(1.0, std::abs(blocks_[c]));
      Eigen::VectorXd more = blocks_, less = blocks_;
      more[c] += step;
      less[c] -= step;
      rows.col(c) = (residuals_at(more) - residuals_at(less)) / (2 * step);
    }
    rows.col(columns()) = residuals_at(blocks_);
    for (int i = 0; i < board_.corners(); ++i) {
      const double px = rows.block<2, 1>(2 * i, columns()).norm();
      rows.middleRows<2>(2 * i) *= std::sqrt(std::min(1.0, kRobustPx / px));
    }
    return rows;
  }

  double loss() const {
    const Eigen::VectorXd all = residuals_at(blocks_);
    double sum = 0;
    for (int i = 0; i < board_.corners(); ++i) {
      const double px = all.segment<2>(2 * i).norm();
      sum += px <= kRobustPx ? px * px : kRobustPx * (2 * px - kRobustPx);
    }
    return sum;
  }

  struct Condensed {
    bool is_valid = false;
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
  };
  Condensed condensed(const Eigen::VectorXd& blocks, bool with_jacobian) const {
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const double* at[] = {blocks.data(), blocks.data() + 6, blocks.data() + 12};
    const int rows = residual_.rows();
    Rows camera(rows, 6), board(rows, 6), lens(rows, lens_size());
    double* jacobians[] = {camera.data(), board.data(), lens.data()};
    Condensed result{false, Eigen::VectorXd(rows), Eigen::MatrixXd(rows, columns())};
    result.is_valid =
        residual_.evaluate(at, result.residuals.data(), with_jacobian ? jacobians : nullptr);
    if (with_jacobian) result.jacobian << camera, board, lens;
    return result;
  }

  static Eigen::VectorXd start(int lens_size) {
    Eigen::VectorXd blocks(12 + lens_size);
    const double all[] = {0.1, -0.2, 0.05, 0.3, -0.1, 1.5,  0.4,   0.3,   -0.2, -0.1, 0.2,  0.4,
                          900, 920,  500,  390, -0.2, 0.05, 0.001, -5e-4, 0.01, 0.1,  0.02, 0.001};
    std::copy_n(all, blocks.size(), blocks.data());
    return blocks;
  }

  Board board_ = parse_board("chess:7x5:80mm");
  CameraModel camera_ = [] {
    Eigen::Matrix3d k;
    k << 900, 0.7, 500, 0, 920, 390, 0, 0, 1;
    return CameraModel({1024, 768}, k,
                       {-0.2, 0.05, 0.001, -0.0005, 0.01, 0.1, 0.02, 0.001, 0.002, -0.001, 0.001,
                        0.0005, 0.02, -0.03},
                       {});
  }();
  Eigen::VectorXd blocks_ = start(lens_size());
  ReprojectionResidual residual_;
  std::vector<Eigen::Vector2d> pixels_;
};

TEST_P(ReprojectionResiduals, sum_of_squares_is_the_loss_of_all_corners) {
  for (const bool with_jacobian : {false, true}) {
    const Condensed found = condensed(blocks_, with_jacobian);
    ASSERT_TRUE(found.is_valid);
    EXPECT_NEAR(found.residuals.squaredNorm(), loss(), 1e-9 * loss());
  }
}

TEST_P(ReprojectionResiduals, has_the_gradient_and_normal_matrix_of_all_corners) {
  const Condensed found = condensed(blocks_, true);
  ASSERT_TRUE(found.is_valid);
  const Eigen::MatrixXd rows = weighted_rows();
  const Eigen::MatrixXd expected = rows.transpose() * rows.leftCols(columns());
  Eigen::MatrixXd products(columns() + 1, columns());
  products << found.jacobian.transpose() * found.jacobian,
      found.residuals.transpose() * found.jacobian;
  for (int i = 0; i <= columns(); ++i) {
    for (int j = 0; j < columns(); ++j) {
      const double scale = rows.col(i).norm() * rows.col(j).norm();
      EXPECT_NEAR(products(i, j) / scale, expected(i, j) / scale, 1e-6) << i << ", " << j;
    }
  }
}

TEST_P(ReprojectionResiduals, evaluation_fails_for_a_board_behind_the_camera) {
  blocks_[5] -= 10;
  EXPECT_FALSE(condensed(blocks_, false).is_valid);
  EXPECT_FALSE(condensed(blocks_, true).is_valid);
}

INSTANTIATE_TEST_SUITE_P(Coefficients, ReprojectionResiduals, testing::Values(0, 4, 5, 8),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace v3d::calib
