#include "calib/rig/rig_alignment.h"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "calib/boards/board.h"
#include "calib/lens/bundle_adjustment.h"

namespace v3d::calib {
namespace {

using Eigen::Vector3d;

/// The positions of one camera in both calibrations.
struct MatchedCamera {
  std::string name;
  Vector3d previous;
  Vector3d now;
};

std::vector<MatchedCamera> match_cameras(const Rig& now, const Rig& previous_rig) {
  std::vector<MatchedCamera> matched;
  for (const RigCamera& camera : now) {
    const int previous = find_camera(previous_rig, camera.name);
    if (previous < 0) continue;
    matched.push_back({camera.name, previous_rig[static_cast<size_t>(previous)].model.center(),
                       camera.model.center()});
  }
  return matched;
}

double extent_of(const std::vector<MatchedCamera>& cameras) {
  Vector3d low = cameras.front().previous, high = low;
  for (const MatchedCamera& camera : cameras) {
    low = low.cwiseMin(camera.previous);
    high = high.cwiseMax(camera.previous);
  }
  return (high - low).norm();
}

/// Compares sorted distances between cameras. They do not depend on the world frame, nor on the
/// names, so swapped cameras do not change the scale.
double scale_of(const std::vector<MatchedCamera>& cameras) {
  std::vector<double> previous, now;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      previous.push_back((cameras[i].previous - cameras[j].previous).norm());
      now.push_back((cameras[i].now - cameras[j].now).norm());
    }
  }
  std::sort(previous.begin(), previous.end());
  std::sort(now.begin(), now.end());
  std::vector<double> ratios;
  for (size_t i = 0; i < previous.size(); ++i) {
    if (previous[i] > 0) ratios.push_back(now[i] / previous[i]);
  }
  return ratios.empty() ? 1 : upper_median(ratios);
}

/// At least half of the distances between cameras have the ratio `scale`, within 1 %.
bool most_distances_have(double scale, const std::vector<MatchedCamera>& cameras) {
  size_t agreeing = 0, all = 0;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const double expected = scale * (cameras[i].previous - cameras[j].previous).norm();
      const double now = (cameras[i].now - cameras[j].now).norm();
      agreeing += std::abs(now - expected) <= 0.01 * expected;
      ++all;
    }
  }
  return 2 * agreeing >= all;
}

/// The largest distance between the positions now and before, after the best fit, with the names
/// of cameras i and j exchanged.
double max_distance(const std::vector<MatchedCamera>& cameras, size_t i, size_t j) {
  std::vector<Vector3d> from, to;
  for (const MatchedCamera& camera : cameras) {
    from.push_back(camera.now);
    to.push_back(camera.previous);
  }
  std::swap(from[i], from[j]);
  const Similarity fit = align_points(from, to, true);
  double worst = 0;
  for (size_t k = 0; k < from.size(); ++k) worst = std::max(worst, (fit * from[k] - to[k]).norm());
  return worst;
}

}  // namespace

Similarity align_points(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                        bool with_scale) {
  Eigen::Matrix3Xd a(3, from.size()), b(3, to.size());
  for (size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<long>(i)) = from[i];
    b.col(static_cast<long>(i)) = to[i];
  }
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, with_scale);
  Similarity result;
  result.scale = with_scale ? m.block<3, 1>(0, 0).norm() : 1;
  result.rigid.rotation = m.topLeftCorner<3, 3>() / result.scale;
  result.rigid.translation = m.topRightCorner<3, 1>();
  return result;
}

Rig transformed_rig(const Rig& rig, const Similarity& new_from_old) {
  Rig transformed;
  const RigidTransform old_from_new = new_from_old.rigid.inverse();
  for (const RigCamera& camera : rig) {
    const CameraModel& m = camera.model;
    RigidTransform scaled = m.cam_from_world();
    scaled.translation *= new_from_old.scale;
    RigCamera other = camera;
    other.model = CameraModel(m.size(), m.matrix(), m.distortion(), scaled * old_from_new);
    transformed.push_back(std::move(other));
  }
  return transformed;
}

RigDifference compare_rigs(const Rig& now, const Rig& previous) {
  RigDifference difference;
  const std::vector<MatchedCamera> cameras = match_cameras(now, previous);
  if (cameras.size() < 2 || !(extent_of(cameras) > 1e-6)) return difference;
  difference.scale = scale_of(cameras);
  difference.same_shape = most_distances_have(difference.scale, cameras);
  if (cameras.size() < 4) return difference;
  constexpr double kMaxDistance = 0.05;  // of the rig's size
  const double tolerance = kMaxDistance * extent_of(cameras);
  if (max_distance(cameras, 0, 0) < tolerance) return difference;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (max_distance(cameras, i, j) < tolerance)
        difference.swapped.emplace_back(cameras[j].name, cameras[i].name);
    }
  }
  return difference;
}

namespace {

constexpr double kScaleTolerance = 0.01;
constexpr double kMaxRmsPx = 5;

/// The median observation of a board at rest.
BoardObservation median_observation(const Board& board, const CameraObservations& camera) {
  const BoardObservation& first = camera.observations.begin()->second;
  std::map<int, std::pair<std::vector<double>, std::vector<double>>> positions;
  for (const auto& [instant, observation] : camera.observations) {
    const BoardObservation same = turned_like(first, board, observation);
    for (int i = 0; i < same.count(); ++i) {
      positions[same.corners[i]].first.push_back(same.pixels[i].x());
      positions[same.corners[i]].second.push_back(same.pixels[i].y());
    }
  }
  BoardObservation result;
  for (auto& [corner, position] : positions) {
    result.corners.push_back(corner);
    result.pixels.emplace_back(upper_median(position.first), upper_median(position.second));
  }
  return result;
}

struct BoardView {
  int camera = 0;  // of the rig
  BoardObservation observation;
};

/// The point nearest to all rays of a corner; empty for fewer than two rays.
std::optional<Eigen::Vector3d> triangulate(const Rig& rig, const std::vector<BoardView>& views,
                                           int corner) {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int rays = 0;
  for (const BoardView& view : views) {
    for (int i = 0; i < view.observation.count(); ++i) {
      if (view.observation.corners[i] != corner) continue;
      const CameraModel& camera = rig[view.camera].model;
      const auto ray = camera.ray(view.observation.pixels[i]);
      if (!ray) continue;
      const Eigen::Matrix3d a = Eigen::Matrix3d::Identity() - *ray * ray->transpose();
      across += a;
      sum += a * camera.center();
      ++rays;
    }
  }
  if (rays < 2) return std::nullopt;
  return across.ldlt().solve(sum);
}

struct LocatedBoard {
  Similarity board_from_world;
  double rms_m = 0;  ///< root mean square distance of the corners
};

std::optional<LocatedBoard> fit_board(const Rig& rig, const Board& board,
                                      const std::vector<BoardView>& views, bool with_scale) {
  std::vector<Eigen::Vector3d> from, to;
  for (int corner = 0; corner < board.corners(); ++corner) {
    if (const auto point = triangulate(rig, views, corner)) {
      from.push_back(*point);
      to.push_back(board.corner(corner));
    }
  }
  if (from.size() < 4) return std::nullopt;
  LocatedBoard located{align_points(from, to, with_scale), 0};
  for (size_t i = 0; i < from.size(); ++i) {
    located.rms_m += (located.board_from_world * from[i] - to[i]).squaredNorm();
  }
  located.rms_m = std::sqrt(located.rms_m / static_cast<double>(from.size()));
  return located;
}

/// Turns observations of a symmetric board where needed, so that all agree with the first.
void resolve_symmetry(const Rig& rig, const Board& board, std::vector<BoardView>& views) {
  if (!board.has_half_turn_symmetry()) return;
  for (size_t i = 1; i < views.size(); ++i) {
    const std::vector<BoardView> as_seen = {views[0], views[i]};
    std::vector<BoardView> other = as_seen;
    other[1].observation = half_turned(board, views[i].observation);
    const auto a = fit_board(rig, board, as_seen, true), b = fit_board(rig, board, other, true);
    if (a && b && b->rms_m < a->rms_m) views[i] = other[1];
  }
}

std::vector<BoardView> views_of(const Rig& rig, const Board& board,
                                const std::vector<CameraObservations>& cameras) {
  std::vector<BoardView> views;
  for (const CameraObservations& camera : cameras) {
    if (camera.observations.empty()) continue;
    const int index = find_camera(rig, camera.name);
    if (index < 0) throw InputError(camera.name + ": the calibration has no such camera");
    if (!(rig[static_cast<size_t>(index)].model.size() == camera.size)) {
      throw InputError(camera.name +
                       ": the size of its images differs from that of its calibration");
    }
    views.push_back({index, median_observation(board, camera)});
  }
  if (views.size() < 2) {
    throw InputError("too few boards: " +
                     std::string(views.empty() ? "no camera sees" : "only one camera sees") +
                     " the board on the floor; two or more are needed");
  }
  return views;
}

/// Adjusts the pose of the board; the cameras are constant.
Bundle adjust_board(const Rig& rig, const Board& board, const std::vector<BoardView>& views,
                    const RigidTransform& world_from_board) {
  Bundle bundle{board, {}, {world_from_board}, {}};
  BundleOptions options;
  options.fixed_cameras.clear();
  for (size_t i = 0; i < views.size(); ++i) {
    bundle.cameras.push_back(rig[views[i].camera].model);
    options.fixed_cameras.push_back(static_cast<int>(i));
    for (int k = 0; k < views[i].observation.count(); ++k) {
      bundle.observations.push_back({static_cast<int>(i), 0, views[i].observation.corners[k],
                                     views[i].observation.pixels[k]});
    }
  }
  adjust(bundle, options);
  return bundle;
}

/// The board normal in the rig's world, from one camera. The one of the two possible tilts that is
/// nearer to `expected`.
Eigen::Vector3d observed_normal(const CameraModel& camera, const Board& board,
                                const BoardObservation& observation,
                                const Eigen::Vector3d& expected) {
  Eigen::Vector3d nearest = expected;
  double nearest_dot = -1;
  for (const BoardPose& pose : board_poses(camera, board, observation)) {
    const Eigen::Vector3d normal =
        camera.cam_from_world().rotation.transpose() * pose.cam_from_board.rotation.col(2);
    if (normal.dot(expected) > nearest_dot) {
      nearest_dot = normal.dot(expected);
      nearest = normal;
    }
  }
  return nearest;
}

double disagreement_deg(const Rig& rig, const Board& board, const std::vector<BoardView>& views,
                        const Eigen::Vector3d& expected) {
  std::vector<Eigen::Vector3d> normals;
  for (const BoardView& view : views) {
    normals.push_back(observed_normal(rig[view.camera].model, board, view.observation, expected));
  }
  double largest = 0;
  for (const Eigen::Vector3d& a : normals) {
    for (const Eigen::Vector3d& b : normals) {
      largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  }
  return largest * 180 / std::numbers::pi;
}

void require_plausible(const FloorFit& fit) {
  if (!(fit.rms_px < kMaxRmsPx)) {
    throw InputError(
        fmt::format("the board does not fit the calibration (RMS residual {:.1f} px): was a camera "
                    "moved or swapped, or is the board incomplete or not flat?",
                    fit.rms_px));
  }
  for (const int camera : fit.cameras) {
    if (fit.rig[camera].model.center().z() > 0) continue;
    throw InputError(fit.rig[camera].name + " would be below the floor: is the print mirrored?");
  }
}

}  // namespace

std::optional<Similarity> locate_board(const Rig& rig, const Board& board,
                                       const std::vector<CameraObservations>& cameras) {
  std::vector<BoardView> views = views_of(rig, board, cameras);
  resolve_symmetry(rig, board, views);
  const auto found = fit_board(rig, board, views, true);
  return found ? std::optional(found->board_from_world) : std::nullopt;
}

std::vector<std::string> find_weaknesses(const FloorFit& fit) {
  constexpr double kMaxDisagreementDeg = 1;  // a small, distant board contributes half of it
  if (!(fit.disagreement_deg > kMaxDisagreementDeg)) return {};
  return {fmt::format(
      "two cameras see the board's normal {:.1f} degrees apart, so their calibrated directions are "
      "inaccurate; calibrate the rig again",
      fit.disagreement_deg)};
}

FloorFit fit_floor(const Rig& rig, const Board& board,
                   const std::vector<CameraObservations>& cameras) {
  std::vector<BoardView> views = views_of(rig, board, cameras);
  resolve_symmetry(rig, board, views);
  const auto found = fit_board(rig, board, views, true);
  if (!found) throw InputError("too few boards: no two cameras see the same part of the board");
  FloorFit fit;
  fit.board_by_rig = found->board_from_world.scale;
  fit.scaled = std::abs(fit.board_by_rig - 1) > kScaleTolerance;
  Similarity scaling;
  if (fit.scaled) scaling.scale = fit.board_by_rig;
  const Rig scaled = transformed_rig(rig, scaling);
  const RigidTransform first =
      fit_board(scaled, board, views, false)->board_from_world.rigid.inverse();
  const Bundle bundle = adjust_board(scaled, board, views, first);
  fit.new_from_old = {scaling.scale, bundle.world_from_board.front().inverse()};
  fit.rig = transformed_rig(rig, fit.new_from_old);
  const auto all = residuals(bundle);
  fit.rms_px = rms_of(all);
  fit.disagreement_deg =
      disagreement_deg(rig, board, views, bundle.world_from_board.front().rotation.col(2));
  for (const BoardView& view : views) fit.cameras.push_back(view.camera);
  require_plausible(fit);
  return fit;
}

}  // namespace v3d::calib
