#include "calib/rig/silhouette_refinement.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/rig/epipolar_tangents.h"
#include "calib/rig/rig_comparison.h"

namespace v3d::calib {
namespace {

constexpr int kHoldOutEvery = 3;
constexpr double kProof = 0.6;  // of the disagreement before, or less: the new rig is better
constexpr int kFewestTangents = 50;

/// How a camera is moved, all in pixels: turned by v / f, its centre by v * distance / f, its focal
/// length so that the image's border moves by v; and how much too narrow its silhouettes are on
/// every side, which is no fault of the calibration.
constexpr int kFocal = 6;
constexpr int kWidth = 7;
constexpr int kMoves = 8;
using Moves = std::array<double, kMoves>;

double focal(const CameraModel& camera) { return camera.matrix()(0, 0); }

/// The camera as it was, and the units of its moves.
struct Start {
  Eigen::Matrix3d turn;
  Eigen::Vector3d centre;
  double radians_per_px, metres_per_px, scale_per_px;

  Start(const CameraModel& camera, double distance_m)
      : turn(camera.cam_from_world().rotation),
        centre(camera.center()),
        radians_per_px(1 / focal(camera)),
        metres_per_px(distance_m / focal(camera)),
        scale_per_px(2.0 / camera.size().width) {}
};

template <class T>
struct Placed {
  Eigen::Matrix<T, 3, 3> turn;
  Eigen::Matrix<T, 3, 1> centre;

  Placed(const Start& start, const T* moves) {
    const Eigen::Matrix<T, 3, 1> vector =
        Eigen::Map<const Eigen::Matrix<T, 3, 1>>(moves) * T(start.radians_per_px);
    Eigen::Matrix<T, 3, 3> more;
    ceres::AngleAxisToRotationMatrix(vector.data(), more.data());
    turn = more * start.turn.cast<T>();
    centre = start.centre.cast<T>() +
             Eigen::Map<const Eigen::Matrix<T, 3, 1>>(moves + 3) * T(start.metres_per_px);
  }
};

/// By how much the planes of a tangent disagree, pixels.
struct TangentMiss {
  Tangent tangent;  ///< with the focal lengths now
  const Start& start_a;
  const Start& start_b;
  double scale_a, scale_b;  ///< of the focal lengths now

  template <class T>
  bool operator()(const T* a, const T* b, T* miss) const {
    const Placed<T> placed_a(start_a, a), placed_b(start_b, b);
    const T angle =
        angle_between<T>(tangent, stretched(placed_a, start_a, a, scale_a), placed_a.centre,
                         stretched(placed_b, start_b, b, scale_b), placed_b.centre);
    *miss = (angle + a[kWidth] * T(tangent.wider_a) - b[kWidth] * T(tangent.wider_b)) *
            T(tangent.px_per_radian());
    return true;
  }

  /// A longer focal length draws the rays together: the same as a longer optical axis.
  template <class T>
  static Eigen::Matrix<T, 3, 3> stretched(const Placed<T>& placed, const Start& start,
                                          const T* moves, double now) {
    Eigen::Matrix<T, 3, 3> turn = placed.turn;
    turn.row(2) *= (T(1) + moves[kFocal] * T(start.scale_per_px)) / T(now);
    return turn;
  }
};
using TangentCost = ceres::AutoDiffCostFunction<TangentMiss, 1, kMoves, kMoves>;

/// Draws the moves to nothing.
struct Stay {
  double expected_px;
  template <class T>
  bool operator()(const T* moves, T* miss) const {
    for (int i = 0; i < kWidth; ++i) miss[i] = moves[i] / T(expected_px);
    miss[kWidth] = moves[kWidth];
    return true;
  }
};
using StayCost = ceres::AutoDiffCostFunction<Stay, kMoves, kMoves>;

double scale_of(const Start& start, const Moves& moves) {
  return 1 + moves[kFocal] * start.scale_per_px;
}

CameraModel moved(const CameraModel& before, const Start& start, const Moves& moves) {
  const Placed<double> placed(start, moves.data());
  Eigen::Matrix3d k = before.matrix();
  k.topLeftCorner<2, 2>() *= scale_of(start, moves);
  return {before.size(), k, before.distortion(), {placed.turn, -(placed.turn * placed.centre)}};
}

/// By a lens whose focal length is `scale` times as long.
Outline scaled(Outline outline, double scale) {
  for (Eigen::Vector3d& ray : outline.rays) ray.head<2>() /= scale;
  outline.middle.head<2>() /= scale;
  return outline;
}

class Refiner {
 public:
  Refiner(const Rig& rig, const std::vector<SilhouetteSet>& sets, const RefineOptions& options)
      : rig_(rig), before_(models_of(rig)), options_(options), moves_(rig.size(), Moves{}) {
    for (const SilhouetteSet& set : sets) {
      outlines_.emplace_back();
      for (size_t c = 0; c < before_.size(); ++c) {
        outlines_.back().push_back(set[c] != nullptr ? outline_of(*set[c], before_[c]) : Outline());
      }
    }
  }

  RefineResult refine() {
    const std::vector<Tangent> first = tangents(before_, false);
    require_tangents(first);
    amid_ = first.front().amid;
    for (const CameraModel& camera : before_) {
      starts_.emplace_back(camera, (amid_ - camera.center()).norm());
    }
    constexpr int kRounds = 8;
    for (int round = 0; round < kRounds; ++round) improve({0, 1, 2, 3, 4, 5, kFocal});
    const std::vector<Miss> then = residuals(before_, true);
    const std::vector<int> held = options_.focal_lengths ? std::vector<int>() : std::vector{kFocal};
    for (int round = 0; round < kRounds; ++round) improve(held);
    const std::vector<CameraModel> after = put_back(cameras());
    return judged(after, then, residuals(after, true));
  }

 private:
  /// By how much the planes of a tangent of two cameras disagree, beyond the widths of their
  /// silhouettes.
  struct Miss {
    int a, b;
    double px;
  };

  std::vector<Miss> residuals(const std::vector<CameraModel>& cameras, bool held_out) const {
    std::vector<Miss> result;
    for (const Tangent& t : tangents(cameras, held_out)) {
      const double angle = angle_between(t, cameras[t.a], cameras[t.b]) +
                           moves_[t.a][kWidth] * t.wider_a - moves_[t.b][kWidth] * t.wider_b;
      result.push_back({t.a, t.b, std::abs(angle) * t.px_per_radian()});
    }
    return result;
  }

  /// Median of those that have to do with a camera; of all: -1.
  static double median_of(const std::vector<Miss>& residuals, int camera) {
    std::vector<double> values;
    for (const Miss& miss : residuals) {
      if (camera < 0 || miss.a == camera || miss.b == camera) values.push_back(miss.px);
    }
    return upper_median(std::move(values));
  }

  std::vector<CameraModel> cameras() const {
    std::vector<CameraModel> result;
    for (size_t c = 0; c < before_.size(); ++c) {
      result.push_back(moved(before_[c], starts_[c], moves_[c]));
    }
    return result;
  }

  /// Of the instants that are held out, or of the others. Where planes touch depends on the places
  /// of the cameras, the rays on their focal lengths.
  std::vector<Tangent> tangents(const std::vector<CameraModel>& cameras, bool held_out) const {
    std::vector<Tangent> all;
    for (size_t s = 0; s < outlines_.size(); ++s) {
      if ((s % kHoldOutEvery == kHoldOutEvery - 1) != held_out) continue;
      std::vector<Outline> outlines;
      for (size_t c = 0; c < cameras.size(); ++c) {
        outlines.push_back(
            scaled(outlines_[s][c], cameras[c].matrix()(0, 0) / before_[c].matrix()(0, 0)));
      }
      const std::vector<Tangent> some = tangents_of(cameras, outlines);
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }

  static void require_tangents(const std::vector<Tangent>& tangents) {
    if (std::ssize(tangents) >= kFewestTangents) return;
    throw InputError("refine: the silhouettes say too little: only " +
                     std::to_string(tangents.size()) + " planes touch those of two cameras; at " +
                     "least " + std::to_string(kFewestTangents) + " are needed");
  }

  /// One round: the tangents where they are now, and all cameras moved to where they agree best.
  /// `held`: moves that stay.
  void improve(const std::vector<int>& held) {
    const std::vector<CameraModel> now = cameras();
    const std::vector<Tangent> touching = tangents(now, false);
    const double robust = std::max(0.5, 1.5 * median_of(residuals(now, false), -1));
    std::vector<double> scales;
    for (size_t c = 0; c < now.size(); ++c) scales.push_back(scale_of(starts_[c], moves_[c]));
    ceres::Problem problem;
    for (const Tangent& t : touching) {
      problem.AddResidualBlock(
          new TangentCost(new TangentMiss{t, starts_[t.a], starts_[t.b], scales[t.a], scales[t.b]}),
          new ceres::CauchyLoss(robust), moves_[t.a].data(), moves_[t.b].data());
    }
    for (Moves& moves : moves_) hold(problem, moves, held);
    solve(problem);
  }

  void hold(ceres::Problem& problem, Moves& moves, const std::vector<int>& held) const {
    problem.AddResidualBlock(new StayCost(new Stay{options_.expected_px}), nullptr, moves.data());
    if (!held.empty()) problem.SetManifold(moves.data(), new ceres::SubsetManifold(kMoves, held));
  }

  void solve(ceres::Problem& problem) const {
    ceres::Solver::Options how;
    how.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    how.max_num_iterations = 12;
    how.num_threads = options_.threads;
    how.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(how, &problem, &summary);
  }

  /// Where the rig as a whole was.
  std::vector<CameraModel> put_back(const std::vector<CameraModel>& cameras) const {
    std::vector<Eigen::Vector3d> from, to;
    Rig now = rig_;
    for (size_t c = 0; c < cameras.size(); ++c) {
      from.push_back(cameras[c].center());
      to.push_back(before_[c].center());
      now[c].model = cameras[c];
    }
    return models_of(moved_rig(now, align_points(from, to, true)));
  }

  RefineResult judged(const std::vector<CameraModel>& after, const std::vector<Miss>& then,
                      const std::vector<Miss>& now) const {
    RefineResult result;
    result.rig = rig_;
    result.before_px = median_of(then, -1);
    result.after_px = median_of(now, -1);
    result.better = result.after_px < kProof * result.before_px;
    for (size_t c = 0; c < rig_.size(); ++c) {
      const auto camera = static_cast<int>(c);
      const auto tangents = std::ranges::count_if(
          then, [&](const Miss& miss) { return miss.a == camera || miss.b == camera; });
      result.cameras.push_back({static_cast<int>(tangents), median_of(then, camera),
                                median_of(now, camera), shift_px(before_[c], after[c], amid_)});
      if (result.better) result.rig[c].model = after[c];
    }
    return result;
  }

  static double shift_px(const CameraModel& before, const CameraModel& after,
                         const Eigen::Vector3d& place) {
    const auto then = before.project(place), now = after.project(place);
    return then && now ? (*now - *then).norm() : 0;
  }

  const Rig& rig_;
  const std::vector<CameraModel> before_;
  const RefineOptions& options_;
  std::vector<std::vector<Outline>>
      outlines_;  ///< by instant, by camera, through the lenses before
  Eigen::Vector3d amid_ = Eigen::Vector3d::Zero();  ///< what the cameras look at
  std::vector<Start> starts_;
  std::vector<Moves> moves_;
};

}  // namespace

RefineResult refine_by_silhouettes(const Rig& rig, const std::vector<SilhouetteSet>& sets,
                                   const RefineOptions& options) {
  if (std::ssize(sets) < kFewestSets) {
    throw InputError("refine: " + std::to_string(sets.size()) + " instants are too few; at least " +
                     std::to_string(kFewestSets) + " are needed, 40 are good");
  }
  return Refiner(rig, sets, options).refine();
}

}  // namespace v3d::calib
