#include "calib/rig/silhouette_refinement.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/geometry/rigid_transform.h"
#include "calib/rig/rig_alignment.h"

namespace v3d::calib {
namespace {

constexpr int kHoldOutEvery = 3;
constexpr double kMaxErrorRatio = 0.6;  // of the error before; above it, the rig is kept
constexpr double kLostPx = 1000;        // the error of a tangent that the refined cameras lack
constexpr int kMinTangents = 50;

/// The parameters of one camera, all in pixels of image motion: rotation (3), translation (3),
/// focal length, and the width error of its silhouettes. The width error belongs to the
/// segmentation.
constexpr int kFocal = 6;
constexpr int kWidth = 7;
constexpr int kParameters = 8;
using Parameters = std::array<double, kParameters>;

double focal(const CameraModel& camera) { return camera.matrix()(0, 0); }

/// The camera before refinement, and the units of its parameters.
struct StartCamera {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d centre;
  double radians_per_px, metres_per_px, scale_per_px;

  StartCamera(const CameraModel& camera, double distance_m)
      : rotation(camera.cam_from_world().rotation),
        centre(camera.center()),
        radians_per_px(1 / focal(camera)),
        metres_per_px(distance_m / focal(camera)),
        scale_per_px(2.0 / camera.size().width) {}
};

template <class T>
struct UpdatedPose {
  Eigen::Matrix<T, 3, 3> rotation;
  Eigen::Matrix<T, 3, 1> centre;

  UpdatedPose(const StartCamera& start, const T* parameters) {
    const Eigen::Matrix<T, 3, 1> vector =
        Eigen::Map<const Eigen::Matrix<T, 3, 1>>(parameters) * T(start.radians_per_px);
    Eigen::Matrix<T, 3, 3> update;
    ceres::AngleAxisToRotationMatrix(vector.data(), update.data());
    rotation = update * start.rotation.cast<T>();
    centre = start.centre.cast<T>() +
             Eigen::Map<const Eigen::Matrix<T, 3, 1>>(parameters + 3) * T(start.metres_per_px);
  }
};

/// The residual of an epipolar tangent, pixels.
struct TangentResidual {
  EpipolarTangent tangent;  ///< with the current focal lengths
  const StartCamera& start_a;
  const StartCamera& start_b;
  double scale_a, scale_b;  ///< current factors of the focal lengths

  template <class T>
  bool operator()(const T* a, const T* b, T* residual) const {
    const UpdatedPose<T> pose_a(start_a, a), pose_b(start_b, b);
    const T angle =
        angle_between<T>(tangent, scaled_rotation(pose_a, start_a, a, scale_a), pose_a.centre,
                         scaled_rotation(pose_b, start_b, b, scale_b), pose_b.centre);
    *residual =
        (angle + a[kWidth] * T(tangent.rad_per_px_a) - b[kWidth] * T(tangent.rad_per_px_b)) *
        T(tangent.px_per_radian());
    return true;
  }

  /// A longer focal length narrows the rays. Scaling the optical axis has the same effect.
  template <class T>
  static Eigen::Matrix<T, 3, 3> scaled_rotation(const UpdatedPose<T>& pose,
                                                const StartCamera& start, const T* parameters,
                                                double now) {
    Eigen::Matrix<T, 3, 3> rotation = pose.rotation;
    rotation.row(2) *= (T(1) + parameters[kFocal] * T(start.scale_per_px)) / T(now);
    return rotation;
  }
};
using TangentCost = ceres::AutoDiffCostFunction<TangentResidual, 1, kParameters, kParameters>;

/// Prior of the parameters: 0 with standard deviation `expected_px` (width error: 1 px).
struct ParameterPrior {
  double expected_px;
  template <class T>
  bool operator()(const T* parameters, T* residual) const {
    for (int i = 0; i < kWidth; ++i) residual[i] = parameters[i] / T(expected_px);
    residual[kWidth] = parameters[kWidth];
    return true;
  }
};
using PriorCost = ceres::AutoDiffCostFunction<ParameterPrior, kParameters, kParameters>;

double scale_of(const StartCamera& start, const Parameters& parameters) {
  return 1 + parameters[kFocal] * start.scale_per_px;
}

CameraModel updated(const CameraModel& before, const StartCamera& start,
                    const Parameters& parameters) {
  const UpdatedPose<double> pose(start, parameters.data());
  Eigen::Matrix3d k = before.matrix();
  k.topLeftCorner<2, 2>() *= scale_of(start, parameters);
  return {before.size(), k, before.distortion(), {pose.rotation, -(pose.rotation * pose.centre)}};
}

/// The outline through a lens whose focal length is multiplied by `scale`.
Outline scaled(Outline outline, double scale) {
  for (Eigen::Vector3d& ray : outline.rays) ray.head<2>() /= scale;
  outline.middle.head<2>() /= scale;
  return outline;
}

class Refiner {
 public:
  Refiner(const Rig& rig, const std::vector<SilhouetteSet>& sets, const RefineOptions& options)
      : rig_(rig),
        before_(models_of(rig)),
        options_(options),
        parameters_(rig.size(), Parameters{}) {
    for (const SilhouetteSet& set : sets) {
      outlines_.emplace_back();
      for (size_t c = 0; c < before_.size(); ++c) {
        outlines_.back().push_back(set[c] != nullptr ? outline_of(*set[c], before_[c]) : Outline());
      }
    }
  }

  RefineResult refine() {
    const std::vector<EpipolarTangent> first = tangents(before_, false);
    require_tangents(first);
    scene_point_ = first.front().scene_point;
    for (const CameraModel& camera : before_) {
      starts_.emplace_back(camera, (scene_point_ - camera.center()).norm());
    }
    constexpr int kIterations = 8;
    for (int iteration = 0; iteration < kIterations; ++iteration)
      iterate({0, 1, 2, 3, 4, 5, kFocal});
    const std::vector<ErrorPx> before = residuals(before_, true);
    const std::vector<int> constant =
        options_.focal_lengths ? std::vector<int>() : std::vector{kFocal};
    for (int iteration = 0; iteration < kIterations; ++iteration) iterate(constant);
    const std::vector<CameraModel> after = restore_gauge(cameras());
    return evaluate(after, before, residuals(after, true));
  }

 private:
  /// The residual of an epipolar tangent, corrected for the width errors of the silhouettes.
  struct ErrorPx {
    int a, b;
    double px;
  };

  std::vector<ErrorPx> residuals(const std::vector<CameraModel>& cameras, bool held_out) const {
    std::vector<ErrorPx> result;
    for (const EpipolarTangent& t : tangents(cameras, held_out)) {
      const double angle = angle_between(t, cameras[t.a], cameras[t.b]) +
                           parameters_[t.a][kWidth] * t.rad_per_px_a -
                           parameters_[t.b][kWidth] * t.rad_per_px_b;
      result.push_back({t.a, t.b, std::abs(angle) * t.px_per_radian()});
    }
    return result;
  }

  /// The residuals of one camera; `camera` -1: of all cameras.
  static std::vector<double> values_of(const std::vector<ErrorPx>& residuals, int camera) {
    std::vector<double> values;
    for (const ErrorPx& residual : residuals) {
      if (camera < 0 || residual.a == camera || residual.b == camera) values.push_back(residual.px);
    }
    return values;
  }

  static double median_of(const std::vector<ErrorPx>& residuals, int camera) {
    return upper_median(values_of(residuals, camera));
  }

  /// The median of `now`. Tangents that existed before and are gone count with kLostPx; otherwise
  /// cameras without any tangent would seem to be perfect.
  static double median_after(const std::vector<ErrorPx>& before, const std::vector<ErrorPx>& now,
                             int camera) {
    std::vector<double> values = values_of(now, camera);
    values.resize(std::max(values.size(), values_of(before, camera).size()), kLostPx);
    return upper_median(std::move(values));
  }

  std::vector<CameraModel> cameras() const {
    std::vector<CameraModel> result;
    for (size_t c = 0; c < before_.size(); ++c) {
      result.push_back(updated(before_[c], starts_[c], parameters_[c]));
    }
    return result;
  }

  /// The tangents of the held-out instants, or of the other ones. Points of contact depend on the
  /// camera poses, and rays on the focal lengths.
  std::vector<EpipolarTangent> tangents(const std::vector<CameraModel>& cameras,
                                        bool held_out) const {
    std::vector<EpipolarTangent> all;
    for (size_t s = 0; s < outlines_.size(); ++s) {
      if ((s % kHoldOutEvery == kHoldOutEvery - 1) != held_out) continue;
      std::vector<Outline> outlines;
      for (size_t c = 0; c < cameras.size(); ++c) {
        outlines.push_back(
            scaled(outlines_[s][c], cameras[c].matrix()(0, 0) / before_[c].matrix()(0, 0)));
      }
      const std::vector<EpipolarTangent> some = epipolar_tangents(cameras, outlines);
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }

  static void require_tangents(const std::vector<EpipolarTangent>& tangents) {
    if (std::ssize(tangents) >= kMinTangents) return;
    throw InputError("refine: too few silhouettes: only " + std::to_string(tangents.size()) +
                     " epipolar tangents of two cameras; at least " + std::to_string(kMinTangents) +
                     " are needed");
  }

  /// One iteration: finds the tangents of the current cameras, then fits all cameras to them.
  /// `constant`: indices of constant parameters.
  void iterate(const std::vector<int>& constant) {
    const std::vector<CameraModel> now = cameras();
    const std::vector<EpipolarTangent> touching = tangents(now, false);
    const double robust = std::max(0.5, 1.5 * median_of(residuals(now, false), -1));
    std::vector<double> scales;
    for (size_t c = 0; c < now.size(); ++c) scales.push_back(scale_of(starts_[c], parameters_[c]));
    ceres::Problem problem;
    for (const EpipolarTangent& t : touching) {
      problem.AddResidualBlock(new TangentCost(new TangentResidual{t, starts_[t.a], starts_[t.b],
                                                                   scales[t.a], scales[t.b]}),
                               new ceres::CauchyLoss(robust), parameters_[t.a].data(),
                               parameters_[t.b].data());
    }
    for (Parameters& parameters : parameters_) add_prior(problem, parameters, constant);
    solve(problem);
  }

  void add_prior(ceres::Problem& problem, Parameters& parameters,
                 const std::vector<int>& constant) const {
    problem.AddResidualBlock(new PriorCost(new ParameterPrior{options_.expected_px}), nullptr,
                             parameters.data());
    if (!constant.empty())
      problem.SetManifold(parameters.data(), new ceres::SubsetManifold(kParameters, constant));
  }

  void solve(ceres::Problem& problem) const {
    ceres::Solver::Options solver_options;
    solver_options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    solver_options.max_num_iterations = 12;
    solver_options.num_threads = options_.threads;
    solver_options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem, &summary);
  }

  /// Restores position, orientation and scale of the whole rig. The orientation is the mean of the
  /// cameras' orientations: their positions do not determine it when they are in one row.
  std::vector<CameraModel> restore_gauge(const std::vector<CameraModel>& cameras) const {
    Rig now = rig_;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
    Eigen::Vector3d mean = Eigen::Vector3d::Zero(), mean_before = Eigen::Vector3d::Zero();
    const auto count = static_cast<double>(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      turn +=
          before_[c].cam_from_world().rotation.transpose() * cameras[c].cam_from_world().rotation;
      mean += cameras[c].center() / count;
      mean_before += before_[c].center() / count;
      now[c].model = cameras[c];
    }
    Similarity restored;
    restored.rigid.rotation = nearest_rotation(turn);
    double along = 0, square = 0;
    for (size_t c = 0; c < cameras.size(); ++c) {
      const Eigen::Vector3d offset = restored.rigid.rotation * (cameras[c].center() - mean);
      along += offset.dot(before_[c].center() - mean_before);
      square += offset.squaredNorm();
    }
    if (along > 0) restored.scale = along / square;
    restored.rigid.translation = mean_before - restored.rigid.rotation * (restored.scale * mean);
    return models_of(transformed_rig(now, restored));
  }

  RefineResult evaluate(const std::vector<CameraModel>& after, const std::vector<ErrorPx>& before,
                        const std::vector<ErrorPx>& now) const {
    RefineResult result;
    result.rig = rig_;
    result.before_px = median_of(before, -1);
    result.after_px = median_after(before, now, -1);
    result.better = result.after_px < kMaxErrorRatio * result.before_px;
    for (size_t c = 0; c < rig_.size(); ++c) {
      const auto camera = static_cast<int>(c);
      const auto tangents = std::ranges::count_if(before, [&](const ErrorPx& residual) {
        return residual.a == camera || residual.b == camera;
      });
      result.cameras.push_back({static_cast<int>(tangents), median_of(before, camera),
                                median_after(before, now, camera),
                                shift_px(before_[c], after[c], scene_point_)});
      if (result.better) result.rig[c].model = after[c];
    }
    return result;
  }

  static double shift_px(const CameraModel& before, const CameraModel& after,
                         const Eigen::Vector3d& point) {
    const auto from = before.project(point), to = after.project(point);
    return from && to ? (*to - *from).norm() : 0;
  }

  const Rig& rig_;
  const std::vector<CameraModel> before_;
  const RefineOptions& options_;
  std::vector<std::vector<Outline>> outlines_;  ///< by instant and camera, through the given lenses
  Eigen::Vector3d scene_point_ = Eigen::Vector3d::Zero();  ///< world frame
  std::vector<StartCamera> starts_;
  std::vector<Parameters> parameters_;
};

}  // namespace

RefineResult refine_by_silhouettes(const Rig& rig, const std::vector<SilhouetteSet>& sets,
                                   const RefineOptions& options) {
  if (std::ssize(sets) < kMinSilhouetteSets) {
    throw InputError("refine: " + std::to_string(sets.size()) + " instants are too few; at least " +
                     std::to_string(kMinSilhouetteSets) + " are needed, 40 are recommended");
  }
  return Refiner(rig, sets, options).refine();
}

}  // namespace v3d::calib
