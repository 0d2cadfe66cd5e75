#include "calib/lens/reprojection_residual.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace v3d::calib {
namespace {

using PointSlopes = Eigen::Matrix<double, 2, 3>;
using PoseChange = Eigen::Matrix<double, 6, kPoseSize>;

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// A pose's matrix, and how it turns when its rotation vector changes.
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
      turn = s * Eigen::Matrix3d::Identity() + (1 - s) * axis * axis.transpose() +
             c * cross_matrix(axis);
    }
  }

  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  ///< by the vector, about the axes outside
};

bool is_before(const Eigen::Vector3d& in_camera) { return in_camera.z() > 1e-6; }

/// By Huber: what a miss of so many pixels squared costs, and what its square counts for.
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

/// The board in the camera.
struct SightingMiss::Place {
  Place(const double* cam_from_world, const double* world_from_board)
      : camera(cam_from_world),
        board(world_from_board),
        rotation(camera.rotation * board.rotation),
        to_board(camera.rotation * board.translation),
        translation(to_board + camera.translation) {}

  /// How the board turns about its origin, and moves, in the camera, by the camera's pose.
  PoseChange by_camera() const {
    PoseChange change;
    change << camera.turn, Eigen::Matrix3d::Zero(), -cross_matrix(to_board) * camera.turn,
        Eigen::Matrix3d::Identity();
    return change;
  }

  /// And by its own.
  PoseChange by_board() const {
    PoseChange change;
    change << camera.rotation * board.turn, Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(),
        camera.rotation;
    return change;
  }

  Pose camera, board;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d to_board;  ///< from the world's origin, along the camera's axes
  Eigen::Vector3d translation;
};

/// The lens model of base/camera_model.h.
class SightingMiss::Lens {
 public:
  /// `block`: its free numbers, or null.
  Lens(const SightingMiss& sighting, const double* block)
      : values_(sighting.known_lens_),
        skew_(sighting.skew_),
        tilt_(sighting.tilt_),
        tilted_(!tilt_.isIdentity(0)) {
    if (block) std::copy_n(block, sighting.lens_size_, values_.begin());
  }

  Eigen::Vector2d at(const Eigen::Vector3d& p) const {
    const double x = p.x() / p.z(), y = p.y() / p.z(), s = x * x + y * y;
    Eigen::Vector2d bent = bend(x, y, s, radial(s));
    if (tilted_) bent = Eigen::Vector3d(tilt_ * bent.homogeneous()).hnormalized();
    return pixel(bent);
  }

  /// With its slopes by the point, and by the first `kLens` numbers of the lens.
  template <int kLens>
  Eigen::Vector2d at(const Eigen::Vector3d& p, PointSlopes& by_point,
                     Eigen::Matrix<double, 2, kLens>& by_lens) const {
    const double x = p.x() / p.z(), y = p.y() / p.z(), s = x * x + y * y;
    const Radial r = radial(s);
    Eigen::Vector2d bent = bend(x, y, s, r);
    Eigen::Matrix2d scale;
    scale << values_[0], skew_, 0, values_[1];
    if (tilted_) {
      const Eigen::Vector3d q = tilt_ * bent.homogeneous();
      bent = q.hnormalized();
      scale *= (tilt_.topLeftCorner<2, 2>() - bent * tilt_.block<1, 2>(2, 0)) / q.z();
    }
    PointSlopes flatten;
    flatten << 1, 0, -x, 0, 1, -y;
    by_point = scale * bend_by_point(x, y, s, r) * flatten / p.z();
    if constexpr (kLens > 0) {
      by_lens.template leftCols<4>() << bent.x(), 0, 1, 0, 0, bent.y(), 0, 1;
      by_lens.template rightCols<kLens - 4>() =
          scale * bend_by_coefficients(x, y, s, r).leftCols<kLens - 4>();
    }
    return pixel(bent);
  }

 private:
  struct Radial {
    double factor, under;  ///< what x and y are multiplied by; 1 / its denominator
  };

  /// In OpenCV's order, from 0.
  double k(int coefficient) const { return values_[4 + coefficient]; }

  Radial radial(double s) const {
    const double under = 1 / (1 + s * (k(5) + s * (k(6) + s * k(7))));
    return {(1 + s * (k(0) + s * (k(1) + s * k(4)))) * under, under};
  }

  Eigen::Vector2d bend(double x, double y, double s, const Radial& r) const {
    const double xy = 2 * x * y;
    return {x * r.factor + k(2) * xy + k(3) * (s + 2 * x * x) + s * (k(8) + s * k(9)),
            y * r.factor + k(2) * (s + 2 * y * y) + k(3) * xy + s * (k(10) + s * k(11))};
  }

  Eigen::Matrix2d bend_by_point(double x, double y, double s, const Radial& r) const {
    const double slope =
        (k(0) + s * (2 * k(1) + s * 3 * k(4)) - r.factor * (k(5) + s * (2 * k(6) + s * 3 * k(7)))) *
        r.under;  // of the factor, by s
    const double prism_x = k(8) + 2 * k(9) * s, prism_y = k(10) + 2 * k(11) * s;
    const double across = 2 * (x * y * slope + k(2) * x + k(3) * y);
    Eigen::Matrix2d by_point;
    by_point << r.factor + 2 * x * (x * slope + prism_x) + 2 * k(2) * y + 6 * k(3) * x,
        across + 2 * y * prism_x, across + 2 * x * prism_y,
        r.factor + 2 * y * (y * slope + prism_y) + 6 * k(2) * y + 2 * k(3) * x;
    return by_point;
  }

  static Eigen::Matrix<double, 2, 8> bend_by_coefficients(double x, double y, double s,
                                                          const Radial& r) {
    const Eigen::Vector2d top = Eigen::Vector2d(x, y) * (r.under * s), low = -r.factor * top;
    const double xy = 2 * x * y;
    Eigen::Matrix<double, 2, 8> slopes;
    slopes << top, top * s, Eigen::Vector2d(xy, s + 2 * y * y), Eigen::Vector2d(s + 2 * x * x, xy),
        top * (s * s), low, low * s, low * (s * s);
    return slopes;
  }

  Eigen::Vector2d pixel(const Eigen::Vector2d& bent) const {
    return {values_[0] * bent.x() + skew_ * bent.y() + values_[2],
            values_[1] * bent.y() + values_[3]};
  }

  std::array<double, 16> values_;
  double skew_;
  const Eigen::Matrix3d& tilt_;
  bool tilted_;
};

/// Makes few rows of many. Columns: by the board's turn and place in the camera, by the lens, and
/// last the misses.
template <int kLens>
class SightingMiss::Condenser {
 public:
  static constexpr int kColumns = kPoseSize + kLens + 1;
  using Square = Eigen::Matrix<double, kColumns, kColumns>;

  explicit Condenser(size_t corners) {
    rows_.resize(2 * static_cast<Eigen::Index>(corners), kColumns);
  }

  void add(const PointSlopes& by_point, const Eigen::Vector3d& turned,
           const Eigen::Matrix<double, 2, kLens>& by_lens, const Eigen::Vector2d& miss,
           double weight) {
    Eigen::Matrix<double, 2, kColumns> row;
    row << -by_point * cross_matrix(turned), by_point, by_lens, miss;
    if (weight < 1) row *= std::sqrt(weight);
    rows_.template middleRows<2>(filled_) = row;
    filled_ += 2;
  }

  /// As many rows as columns, with the same products of all columns.
  Square condensed() const {
    Square products = Square::Zero();
    products.template selfadjointView<Eigen::Lower>().rankUpdate(rows_.transpose());
    // Scaled, or the rounding of large columns would drown small ones.
    const Eigen::Matrix<double, kColumns, 1> scale =
        products.diagonal().cwiseMax(kLeast).cwiseSqrt();
    const Eigen::Matrix<double, kColumns, 1> less = scale.cwiseInverse();
    const Square whole = products.template selfadjointView<Eigen::Lower>();
    return root_of(less.asDiagonal() * whole * less.asDiagonal()) * scale.asDiagonal();
  }

 private:
  static constexpr double kLeast = 1e-200;
  static constexpr double kRounding = 1e-13;

  /// Cholesky's with the largest pivot first, so that what is left where columns depend on each
  /// other is nothing but rounding (Higham 2002, "Accuracy and Stability", 10.3).
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

SightingMiss::SightingMiss(const CameraModel& camera, int coefficients, double robust_px)
    : known_lens_{camera.matrix()(0, 0), camera.matrix()(1, 1), camera.matrix()(0, 2),
                  camera.matrix()(1, 2)},
      skew_(camera.matrix()(0, 1)),
      tilt_(camera.tilt()),
      lens_size_(coefficients == 0 ? 0 : 4 + coefficients),
      robust_px_(robust_px) {
  std::copy_n(camera.distortion().begin(), known_lens_.size() - 4, known_lens_.begin() + 4);
}

void SightingMiss::add(const Eigen::Vector3d& corner, const Eigen::Vector2d& pixel) {
  corners_.push_back({corner, pixel});
}

bool SightingMiss::evaluate(const double* const* blocks, double* miss, double** slopes) const {
  const Place place(blocks[0], blocks[1]);
  const Lens lens(*this, lens_size_ > 0 ? blocks[2] : nullptr);
  if (!slopes) return sum_losses(lens, place, miss);
  switch (lens_size_) {
    case 0:
      return condense<0>(lens, place, miss, slopes);
    case 8:
      return condense<8>(lens, place, miss, slopes);
    case 9:
      return condense<9>(lens, place, miss, slopes);
    default:
      return condense<kMostLensSize>(lens, place, miss, slopes);
  }
}

bool SightingMiss::sum_losses(const Lens& lens, const Place& place, double* miss) const {
  double sum = 0;
  for (const Corner& corner : corners_) {
    const Eigen::Vector3d p = place.rotation * corner.on_board + place.translation;
    if (!is_before(p)) return false;
    sum += Loss((lens.at(p) - corner.pixel).squaredNorm(), robust_px_).whole;
  }
  std::fill_n(miss, rows(), 0.0);
  miss[0] = std::sqrt(sum);
  return true;
}

template <int kLens>
bool SightingMiss::condense(const Lens& lens, const Place& place, double* miss,
                            double** slopes) const {
  Condenser<kLens> condenser(corners_.size());
  double linear = 0;  // what is lost besides the squares as they count
  for (const Corner& corner : corners_) {
    const Eigen::Vector3d turned = place.rotation * corner.on_board;
    const Eigen::Vector3d p = turned + place.translation;
    if (!is_before(p)) return false;
    PointSlopes by_point;
    Eigen::Matrix<double, 2, kLens> by_lens;
    const Eigen::Vector2d off = lens.at<kLens>(p, by_point, by_lens) - corner.pixel;
    const Loss loss(off.squaredNorm(), robust_px_);
    condenser.add(by_point, turned, by_lens, off, loss.weight);
    linear += loss.whole - loss.weight * off.squaredNorm();
  }
  const typename Condenser<kLens>::Square all = condenser.condensed();
  constexpr int kColumns = Condenser<kLens>::kColumns;
  Eigen::Map<Eigen::Matrix<double, kColumns + 1, 1>>(miss) << all.template rightCols<1>(),
      std::sqrt(std::max(0.0, linear));
  const auto put = [](double* to, const auto& columns) {
    constexpr int kSize = std::decay_t<decltype(columns)>::ColsAtCompileTime;
    Eigen::Map<Eigen::Matrix<double, kColumns + 1, kSize, Eigen::RowMajor>> block(to);
    block.template topRows<kColumns>() = columns;
    block.template bottomRows<1>().setZero();
  };
  if (slopes[0]) put(slopes[0], all.template leftCols<kPoseSize>() * place.by_camera());
  if (slopes[1]) put(slopes[1], all.template leftCols<kPoseSize>() * place.by_board());
  if constexpr (kLens > 0) {
    if (slopes[2]) put(slopes[2], all.template middleCols<kLens>(kPoseSize));
  }
  return true;
}

}  // namespace v3d::calib
