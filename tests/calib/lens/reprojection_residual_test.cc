#include "calib/lens/reprojection_residual.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/board_pose.h"

namespace v3d::calib {
namespace {

constexpr double kRobustPx = 1.5;

/// A skewed, tilted camera with a full lens, a board before it, and what it saw of it, a pixel off,
/// one corner by much more.
class SightingMisses : public testing::TestWithParam<int> {
 protected:
  SightingMisses() : sighting_(camera_, GetParam(), kRobustPx) {
    const CameraModel camera = camera_at(blocks_);
    for (int i = 0; i < board_.corners(); ++i) {
      const Eigen::Vector2d off(std::sin(5.0 * i), std::cos(3.0 * i));
      pixels_.push_back(seen(camera, blocks_, i) + (i == 7 ? 20 : 0.8) * off);
      sighting_.add(board_.corner(i), pixels_.back());
    }
  }

  int lens_size() const { return GetParam() == 0 ? 0 : 4 + GetParam(); }
  int columns() const { return 2 * kPoseSize + lens_size(); }

  /// Camera, board, and the numbers of the lens that are free.
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
  Eigen::Vector2d seen(const CameraModel& camera, const Eigen::VectorXd& blocks, int corner) const {
    return *camera.project(pose(blocks.segment<6>(6)) * board_.corner(corner));
  }
  Eigen::VectorXd misses_at(const Eigen::VectorXd& blocks) const {
    const CameraModel camera = camera_at(blocks);
    Eigen::VectorXd all(2 * board_.corners());
    for (int i = 0; i < board_.corners(); ++i) {
      all.segment<2>(2 * i) = seen(camera, blocks, i) - pixels_[i];
    }
    return all;
  }

  /// Corner by corner: the misses and their slopes by differences, as Huber weighs them.
  Eigen::MatrixXd weighed_rows() const {
    Eigen::MatrixXd rows(2 * board_.corners(), columns() + 1);
    for (int c = 0; c < columns(); ++c) {
      const double step = 1e-6 * std::max(1.0, std::abs(blocks_[c]));
      Eigen::VectorXd more = blocks_, less = blocks_;
      more[c] += step;
      less[c] -= step;
      rows.col(c) = (misses_at(more) - misses_at(less)) / (2 * step);
    }
    rows.col(columns()) = misses_at(blocks_);
    for (int i = 0; i < board_.corners(); ++i) {
      const double px = rows.block<2, 1>(2 * i, columns()).norm();
      rows.middleRows<2>(2 * i) *= std::sqrt(std::min(1.0, kRobustPx / px));
    }
    return rows;
  }

  double loss() const {
    const Eigen::VectorXd misses = misses_at(blocks_);
    double sum = 0;
    for (int i = 0; i < board_.corners(); ++i) {
      const double px = misses.segment<2>(2 * i).norm();
      sum += px <= kRobustPx ? px * px : kRobustPx * (2 * px - kRobustPx);
    }
    return sum;
  }

  struct Condensed {
    bool is_before = false;
    Eigen::VectorXd miss;
    Eigen::MatrixXd slopes;
  };
  Condensed condensed(const Eigen::VectorXd& blocks, bool with_slopes) const {
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const double* at[] = {blocks.data(), blocks.data() + 6, blocks.data() + 12};
    const int rows = sighting_.rows();
    Rows camera(rows, 6), board(rows, 6), lens(rows, lens_size());
    double* slopes[] = {camera.data(), board.data(), lens.data()};
    Condensed result{false, Eigen::VectorXd(rows), Eigen::MatrixXd(rows, columns())};
    result.is_before = sighting_.evaluate(at, result.miss.data(), with_slopes ? slopes : nullptr);
    if (with_slopes) result.slopes << camera, board, lens;
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
  SightingMiss sighting_;
  std::vector<Eigen::Vector2d> pixels_;
};

TEST_P(SightingMisses, squared_add_up_to_the_loss_of_all_corners) {
  for (const bool with_slopes : {false, true}) {
    const Condensed found = condensed(blocks_, with_slopes);
    ASSERT_TRUE(found.is_before);
    EXPECT_NEAR(found.miss.squaredNorm(), loss(), 1e-9 * loss());
  }
}

TEST_P(SightingMisses, have_with_their_slopes_the_products_of_all_corners) {
  const Condensed found = condensed(blocks_, true);
  ASSERT_TRUE(found.is_before);
  const Eigen::MatrixXd rows = weighed_rows();
  const Eigen::MatrixXd expected = rows.transpose() * rows.leftCols(columns());
  Eigen::MatrixXd products(columns() + 1, columns());
  products << found.slopes.transpose() * found.slopes, found.miss.transpose() * found.slopes;
  for (int i = 0; i <= columns(); ++i) {
    for (int j = 0; j < columns(); ++j) {
      const double scale = rows.col(i).norm() * rows.col(j).norm();
      EXPECT_NEAR(products(i, j) / scale, expected(i, j) / scale, 1e-6) << i << ", " << j;
    }
  }
}

TEST_P(SightingMisses, are_none_of_a_board_behind_the_camera) {
  blocks_[5] -= 10;
  EXPECT_FALSE(condensed(blocks_, false).is_before);
  EXPECT_FALSE(condensed(blocks_, true).is_before);
}

INSTANTIATE_TEST_SUITE_P(Coefficients, SightingMisses, testing::Values(0, 4, 5, 8),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace v3d::calib
