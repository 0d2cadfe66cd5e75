#include "calib/lens/reprojection_residual.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace v3d::calib {
namespace {

using PointJacobian = Eigen::Matrix<double, 2, 3>;
using PoseJacobian = Eigen::Matrix<double, 6, kPoseSize>;

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// A pose as a matrix, with the derivative of its rotation by the rotation vector.
struct Pose {
  explicit Pose(const double* block) : translation(block[3], block[4], block[5]) {
    const Eigen::Vector3d vector(block[0], block[1], block[2]);
    const double angle = vector.norm();
    const Eigen::Vector3d axis =
        angle > 0 ? Eigen::Vector3d(vector / angle) : Eigen::Vector3d::UnitX().eval();
    rotation = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    // The left Jacobian of SO(3) (Barfoot 2017, eq. 7.77b).
    if (angle > 1e-8) {
      const double s = std::sin(angle) / angle, c = (1 - std::cos(angle)) / angle;
      left_jacobian = s * Eigen::Matrix3d::Identity() + (1 - s) * axis * axis.transpose() +
                      c * cross_matrix(axis);
    }
  }

  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  Eigen::Matrix3d left_jacobian =
      Eigen::Matrix3d::Identity();  ///< about the axes of the outer frame
};

bool is_in_front(const Eigen::Vector3d& in_camera) { return in_camera.z() > 1e-6; }

/// Huber's loss of a squared residual, and the weight of the square in it.
struct Loss {
  Loss(double squared, double robust) : whole(squared) {
    if (squared <= robust * robust) return;
    const double px = std::sqrt(squared);
    whole = robust * (2 * px - robust);
    weight = robust / px;
  }
  double whole;
  double weight = 1;
};

}  // namespace

/// The pose of the board in the camera frame, with its derivatives.
struct ReprojectionResidual::BoardInCamera {
  BoardInCamera(const double* cam_from_world, const double* world_from_board)
      : camera(cam_from_world),
        board(world_from_board),
        rotation(camera.rotation * board.rotation),
        to_board(camera.rotation * board.translation),
        translation(to_board + camera.translation) {}

  /// Derivative of the board's rotation (about its origin) and translation in the camera frame by
  /// the camera pose.
  PoseJacobian wrt_camera() const {
    PoseJacobian change;
    change << camera.left_jacobian, Eigen::Matrix3d::Zero(),
        -cross_matrix(to_board) * camera.left_jacobian, Eigen::Matrix3d::Identity();
    return change;
  }

  /// The same by the board pose.
  PoseJacobian wrt_board() const {
    PoseJacobian change;
    change << camera.rotation * board.left_jacobian, Eigen::Matrix3d::Zero(),
        Eigen::Matrix3d::Zero(), camera.rotation;
    return change;
  }

  Pose camera, board;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d to_board;  ///< from the world's origin, in the axes of the camera
  Eigen::Vector3d translation;
};

/// The lens model of base/geometry/camera_model.h.
class ReprojectionResidual::Lens {
 public:
  /// `block`: the free values, or null.
  Lens(const ReprojectionResidual& residual, const double* block)
      : values_(residual.known_lens_),
        skew_(residual.skew_),
        tilt_(residual.tilt_),
        tilted_(!tilt_.isIdentity(0)) {
    if (block) std::copy_n(block, residual.lens_size_, values_.begin());
  }

  Eigen::Vector2d at(const Eigen::Vector3d& p) const {
    const double x = p.x() / p.z(), y = p.y() / p.z(), s = x * x + y * y;
    Eigen::Vector2d distorted = distort(x, y, s, radial(s));
    if (tilted_) distorted = Eigen::Vector3d(tilt_ * distorted.homogeneous()).hnormalized();
    return pixel(distorted);
  }

  /// The pixel of a point, with derivatives by the point and by the first `kLens` lens values.
  template <int kLens>
  Eigen::Vector2d at(const Eigen::Vector3d& p, PointJacobian& wrt_point,
                     Eigen::Matrix<double, 2, kLens>& wrt_lens) const {
    const double x = p.x() / p.z(), y = p.y() / p.z(), s = x * x + y * y;
    const Radial r = radial(s);
    Eigen::Vector2d distorted = distort(x, y, s, r);
    Eigen::Matrix2d scale;
    scale << values_[0], skew_, 0, values_[1];
    if (tilted_) {
      const Eigen::Vector3d q = tilt_ * distorted.homogeneous();
      distorted = q.hnormalized();
      scale *= (tilt_.topLeftCorner<2, 2>() - distorted * tilt_.block<1, 2>(2, 0)) / q.z();
    }
    PointJacobian flatten;
    flatten << 1, 0, -x, 0, 1, -y;
    wrt_point = scale * distort_wrt_point(x, y, s, r) * flatten / p.z();
    if constexpr (kLens > 0) {
      wrt_lens.template leftCols<4>() << distorted.x(), 0, 1, 0, 0, distorted.y(), 0, 1;
      wrt_lens.template rightCols<kLens - 4>() =
          scale * distort_wrt_coefficients(x, y, s, r).leftCols<kLens - 4>();
    }
    return pixel(distorted);
  }

 private:
  struct Radial {
    double factor, under;  ///< factor of x and y; 1 / its denominator
  };

  /// Coefficients in OpenCV's order, from 0.
  double k(int coefficient) const { return values_[4 + coefficient]; }

  Radial radial(double s) const {
    const double under = 1 / (1 + s * (k(5) + s * (k(6) + s * k(7))));
    return {(1 + s * (k(0) + s * (k(1) + s * k(4)))) * under, under};
  }

  Eigen::Vector2d distort(double x, double y, double s, const Radial& r) const {
    const double xy = 2 * x * y;
    return {x * r.factor + k(2) * xy + k(3) * (s + 2 * x * x) + s * (k(8) + s * k(9)),
            y * r.factor + k(2) * (s + 2 * y * y) + k(3) * xy + s * (k(10) + s * k(11))};
  }

  Eigen::Matrix2d distort_wrt_point(double x, double y, double s, const Radial& r) const {
    const double derivative =
        (k(0) + s * (2 * k(1) + s * 3 * k(4)) - r.factor * (k(5) + s * (2 * k(6) + s * 3 * k(7)))) *
        r.under;  // derivative of the factor by s
    const double prism_x = k(8) + 2 * k(9) * s, prism_y = k(10) + 2 * k(11) * s;
    const double across = 2 * (x * y * derivative + k(2) * x + k(3) * y);
    Eigen::Matrix2d wrt_point;
    wrt_point << r.factor + 2 * x * (x * derivative + prism_x) + 2 * k(2) * y + 6 * k(3) * x,
        across + 2 * y * prism_x, across + 2 * x * prism_y,
        r.factor + 2 * y * (y * derivative + prism_y) + 6 * k(2) * y + 2 * k(3) * x;
    return wrt_point;
  }

  static Eigen::Matrix<double, 2, 8> distort_wrt_coefficients(double x, double y, double s,
                                                              const Radial& r) {
    const Eigen::Vector2d top = Eigen::Vector2d(x, y) * (r.under * s), low = -r.factor * top;
    const double xy = 2 * x * y;
    Eigen::Matrix<double, 2, 8> jacobians;
    jacobians << top, top * s, Eigen::Vector2d(xy, s + 2 * y * y),
        Eigen::Vector2d(s + 2 * x * x, xy), top * (s * s), low, low * s, low * (s * s);
    return jacobians;
  }

  Eigen::Vector2d pixel(const Eigen::Vector2d& distorted) const {
    return {values_[0] * distorted.x() + skew_ * distorted.y() + values_[2],
            values_[1] * distorted.y() + values_[3]};
  }

  std::array<double, 16> values_;
  double skew_;
  const Eigen::Matrix3d& tilt_;
  bool tilted_;
};

/// Condenses many residual rows to few. Columns: derivatives by the board's rotation and
/// translation in the camera, derivatives by the lens, and last the residuals.
template <int kLens>
class ReprojectionResidual::Condenser {
 public:
  static constexpr int kColumns = kPoseSize + kLens + 1;
  using Square = Eigen::Matrix<double, kColumns, kColumns>;

  explicit Condenser(size_t corners) {
    rows_.resize(2 * static_cast<Eigen::Index>(corners), kColumns);
  }

  void add(const PointJacobian& wrt_point, const Eigen::Vector3d& rotated,
           const Eigen::Matrix<double, 2, kLens>& wrt_lens, const Eigen::Vector2d& residual,
           double weight) {
    Eigen::Matrix<double, 2, kColumns> row;
    row << -wrt_point * cross_matrix(rotated), wrt_point, wrt_lens, residual;
    if (weight < 1) row *= std::sqrt(weight);
    rows_.template middleRows<2>(filled_) = row;
    filled_ += 2;
  }

  /// A square root of the normal matrix: as many rows as columns, with the same column products.
  Square condensed() const {
    Square products = Square::Zero();
    products.template selfadjointView<Eigen::Lower>().rankUpdate(rows_.transpose());
    // Scaled, because rounding errors of large columns would exceed small columns.
    const Eigen::Matrix<double, kColumns, 1> scale =
        products.diagonal().cwiseMax(kMinSquare).cwiseSqrt();
    const Eigen::Matrix<double, kColumns, 1> inverse_scale = scale.cwiseInverse();
    const Square whole = products.template selfadjointView<Eigen::Lower>();
    return root_of(inverse_scale.asDiagonal() * whole * inverse_scale.asDiagonal()) *
           scale.asDiagonal();
  }

 private:
  static constexpr double kMinSquare = 1e-200;
  static constexpr double kRounding = 1e-13;

  /// Pivoted Cholesky decomposition. With linearly dependent columns, the remainder is rounding
  /// error only (Higham 2002, "Accuracy and Stability", 10.3).
  static Square root_of(Square products) {
    Square root = Square::Zero();
    for (int row = 0; row < kColumns; ++row) {
      Eigen::Index pivot = 0;
      const double largest = products.diagonal().maxCoeff(&pivot);
      if (largest < kRounding) break;
      root.row(row) = products.row(pivot) / std::sqrt(largest);
      products -= root.row(row).transpose() * root.row(row);
      products.row(pivot).setZero();
      products.col(pivot).setZero();
    }
    return root;
  }

  Eigen::Matrix<double, Eigen::Dynamic, kColumns> rows_;
  Eigen::Index filled_ = 0;
};

ReprojectionResidual::ReprojectionResidual(const CameraModel& camera, int coefficients,
                                           double robust_px)
    : known_lens_{camera.matrix()(0, 0), camera.matrix()(1, 1), camera.matrix()(0, 2),
                  camera.matrix()(1, 2)},
      skew_(camera.matrix()(0, 1)),
      tilt_(camera.tilt()),
      lens_size_(coefficients == 0 ? 0 : 4 + coefficients),
      robust_px_(robust_px) {
  std::copy_n(camera.distortion().begin(), known_lens_.size() - 4, known_lens_.begin() + 4);
}

void ReprojectionResidual::add(const Eigen::Vector3d& corner, const Eigen::Vector2d& pixel) {
  corners_.push_back({corner, pixel});
}

bool ReprojectionResidual::evaluate(const double* const* blocks, double* residuals,
                                    double** jacobians) const {
  const BoardInCamera board(blocks[0], blocks[1]);
  const Lens lens(*this, lens_size_ > 0 ? blocks[2] : nullptr);
  if (!jacobians) return sum_losses(lens, board, residuals);
  switch (lens_size_) {
    case 0:
      return condense<0>(lens, board, residuals, jacobians);
    case 8:
      return condense<8>(lens, board, residuals, jacobians);
    case 9:
      return condense<9>(lens, board, residuals, jacobians);
    default:
      return condense<kMaxLensSize>(lens, board, residuals, jacobians);
  }
}

bool ReprojectionResidual::sum_losses(const Lens& lens, const BoardInCamera& board,
                                      double* residuals) const {
  double sum = 0;
  for (const Corner& corner : corners_) {
    const Eigen::Vector3d p = board.rotation * corner.on_board + board.translation;
    if (!is_in_front(p)) return false;
    sum += Loss((lens.at(p) - corner.pixel).squaredNorm(), robust_px_).whole;
  }
  std::fill_n(residuals, rows(), 0.0);
  residuals[0] = std::sqrt(sum);
  return true;
}

template <int kLens>
bool ReprojectionResidual::condense(const Lens& lens, const BoardInCamera& board, double* residuals,
                                    double** jacobians) const {
  Condenser<kLens> condenser(corners_.size());
  double linear = 0;  // part of the loss that the weighted squares do not contain
  for (const Corner& corner : corners_) {
    const Eigen::Vector3d rotated = board.rotation * corner.on_board;
    const Eigen::Vector3d p = rotated + board.translation;
    if (!is_in_front(p)) return false;
    PointJacobian wrt_point;
    Eigen::Matrix<double, 2, kLens> wrt_lens;
    const Eigen::Vector2d residual = lens.at<kLens>(p, wrt_point, wrt_lens) - corner.pixel;
    const Loss loss(residual.squaredNorm(), robust_px_);
    condenser.add(wrt_point, rotated, wrt_lens, residual, loss.weight);
    linear += loss.whole - loss.weight * residual.squaredNorm();
  }
  const typename Condenser<kLens>::Square all = condenser.condensed();
  constexpr int kColumns = Condenser<kLens>::kColumns;
  Eigen::Map<Eigen::Matrix<double, kColumns + 1, 1>>(residuals) << all.template rightCols<1>(),
      std::sqrt(std::max(0.0, linear));
  const auto store = [](double* to, const auto& columns) {
    constexpr int kSize = std::decay_t<decltype(columns)>::ColsAtCompileTime;
    Eigen::Map<Eigen::Matrix<double, kColumns + 1, kSize, Eigen::RowMajor>> block(to);
    block.template topRows<kColumns>() = columns;
    block.template bottomRows<1>().setZero();
  };
  if (jacobians[0]) store(jacobians[0], all.template leftCols<kPoseSize>() * board.wrt_camera());
  if (jacobians[1]) store(jacobians[1], all.template leftCols<kPoseSize>() * board.wrt_board());
  if constexpr (kLens > 0) {
    if (jacobians[2]) store(jacobians[2], all.template middleCols<kLens>(kPoseSize));
  }
  return true;
}

}  // namespace v3d::calib
