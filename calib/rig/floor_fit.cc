#include "calib/rig/floor_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <optional>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/boards/board_pose.h"
#include "calib/lens/bundle_adjustment.h"

namespace v3d::calib {
namespace {

constexpr double kScaleTolerance = 0.01;
constexpr double kMostRmsPx = 5;

double apart(const BoardObservation& a, const BoardObservation& b) {
  double sum = 0;
  for (int i = 0; i < std::min(a.count(), b.count()); ++i)
    sum += (a.pixels[i] - b.pixels[i]).norm();
  return sum;
}

/// One observation of a board that lay still, from many.
BoardObservation at_rest(const Board& board, const CameraObservations& camera) {
  const BoardObservation& first = camera.observations.begin()->second;
  std::map<int, std::pair<std::vector<double>, std::vector<double>>> places;
  for (const auto& [instant, seen] : camera.observations) {
    BoardObservation same = seen;
    if (board.has_half_turn_symmetry()) {
      const BoardObservation other = half_turned(board, seen);
      if (apart(other, first) < apart(seen, first)) same = other;
    }
    for (int i = 0; i < same.count(); ++i) {
      places[same.corners[i]].first.push_back(same.pixels[i].x());
      places[same.corners[i]].second.push_back(same.pixels[i].y());
    }
  }
  BoardObservation result;
  for (auto& [corner, place] : places) {
    result.corners.push_back(corner);
    result.pixels.emplace_back(upper_median(place.first), upper_median(place.second));
  }
  return result;
}

struct Seen {
  int camera = 0;  // of the rig
  BoardObservation observation;
};

/// The point nearest to the rays of the cameras that saw a corner; empty where fewer than two did.
std::optional<Eigen::Vector3d> triangulate(const Rig& rig, const std::vector<Seen>& seen,
                                           int corner) {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int rays = 0;
  for (const Seen& s : seen) {
    for (int i = 0; i < s.observation.count(); ++i) {
      if (s.observation.corners[i] != corner) continue;
      const CameraModel& camera = rig[s.camera].model;
      const auto ray = camera.ray(s.observation.pixels[i]);
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

struct Placed {
  Similarity board_from_world;
  double misfit_m = 0;  ///< root mean square over the corners
};

std::optional<Placed> place(const Rig& rig, const Board& board, const std::vector<Seen>& seen,
                            bool with_scale) {
  std::vector<Eigen::Vector3d> from, to;
  for (int corner = 0; corner < board.corners(); ++corner) {
    if (const auto point = triangulate(rig, seen, corner)) {
      from.push_back(*point);
      to.push_back(board.corner(corner));
    }
  }
  if (from.size() < 4) return std::nullopt;
  Placed placed{align_points(from, to, with_scale), 0};
  for (size_t i = 0; i < from.size(); ++i) {
    placed.misfit_m += (placed.board_from_world * from[i] - to[i]).squaredNorm();
  }
  placed.misfit_m = std::sqrt(placed.misfit_m / static_cast<double>(from.size()));
  return placed;
}

/// Every camera's end first, or last, such that all say the same as the first.
void settle_ends(const Rig& rig, const Board& board, std::vector<Seen>& seen) {
  if (!board.has_half_turn_symmetry()) return;
  for (size_t i = 1; i < seen.size(); ++i) {
    const std::vector<Seen> as_seen = {seen[0], seen[i]};
    std::vector<Seen> other = as_seen;
    other[1].observation = half_turned(board, seen[i].observation);
    const auto a = place(rig, board, as_seen, true), b = place(rig, board, other, true);
    if (a && b && b->misfit_m < a->misfit_m) seen[i] = other[1];
  }
}

std::vector<Seen> seen_by(const Rig& rig, const Board& board,
                          const std::vector<CameraObservations>& cameras) {
  std::vector<Seen> seen;
  for (const CameraObservations& camera : cameras) {
    if (camera.observations.empty()) continue;
    const int index = find_camera(rig, camera.name);
    if (index < 0) throw InputError(camera.name + ": the calibration has no such camera");
    if (!(rig[static_cast<size_t>(index)].model.size() == camera.size)) {
      throw InputError(camera.name + ": the pictures have another size than its calibration");
    }
    seen.push_back({index, at_rest(board, camera)});
  }
  if (seen.size() < 2) {
    throw InputError(
        "too few boards: " + std::string(seen.empty() ? "no camera sees" : "only one camera sees") +
        " the board on the floor; two or more are needed");
  }
  return seen;
}

/// The board's place by the reprojection error of all corners; the cameras stay.
Bundle adjusted(const Rig& rig, const Board& board, const std::vector<Seen>& seen,
                const RigidTransform& world_from_board) {
  Bundle bundle{board, {}, {world_from_board}, {}};
  BundleOptions options;
  options.fixed_cameras.clear();
  for (size_t i = 0; i < seen.size(); ++i) {
    bundle.cameras.push_back(rig[seen[i].camera].model);
    options.fixed_cameras.push_back(static_cast<int>(i));
    for (int k = 0; k < seen[i].observation.count(); ++k) {
      bundle.observations.push_back(
          {static_cast<int>(i), 0, seen[i].observation.corners[k], seen[i].observation.pixels[k]});
    }
  }
  adjust(bundle, options);
  return bundle;
}

/// The board's normal in the rig's world by one camera alone: of the two ways in which a board may
/// lean, the one nearer to `expected`.
Eigen::Vector3d normal_seen_by(const CameraModel& camera, const Board& board,
                               const BoardObservation& observation,
                               const Eigen::Vector3d& expected) {
  Eigen::Vector3d nearest = expected;
  double most = -1;
  for (const BoardPose& pose : board_poses(camera, board, observation)) {
    const Eigen::Vector3d normal =
        camera.cam_from_world().rotation.transpose() * pose.cam_from_board.rotation.col(2);
    if (normal.dot(expected) > most) {
      most = normal.dot(expected);
      nearest = normal;
    }
  }
  return nearest;
}

double disagreement_deg(const Rig& rig, const Board& board, const std::vector<Seen>& seen,
                        const Eigen::Vector3d& expected) {
  std::vector<Eigen::Vector3d> normals;
  for (const Seen& s : seen) {
    normals.push_back(normal_seen_by(rig[s.camera].model, board, s.observation, expected));
  }
  double most = 0;
  for (const Eigen::Vector3d& a : normals) {
    for (const Eigen::Vector3d& b : normals) {
      most = std::max(most, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  }
  return most * 180 / std::numbers::pi;
}

void require_sense(const FloorFit& fit) {
  if (!(fit.rms_px < kMostRmsPx)) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "the board does not fit the calibration (%.1f px): was a camera moved or swapped "
                  "since, or is the board not whole or not flat?",
                  fit.rms_px);
    throw InputError(text);
  }
  for (const int camera : fit.cameras) {
    if (fit.rig[camera].model.center().z() > 0) continue;
    throw InputError(fit.rig[camera].name + " would stand below the floor: mirrored print?");
  }
}

}  // namespace

std::optional<Similarity> place_board(const Rig& rig, const Board& board,
                                      const std::vector<CameraObservations>& cameras) {
  std::vector<Seen> seen = seen_by(rig, board, cameras);
  settle_ends(rig, board, seen);
  const auto found = place(rig, board, seen, true);
  return found ? std::optional(found->board_from_world) : std::nullopt;
}

FloorFit fit_floor(const Rig& rig, const Board& board,
                   const std::vector<CameraObservations>& cameras) {
  std::vector<Seen> seen = seen_by(rig, board, cameras);
  settle_ends(rig, board, seen);
  const auto found = place(rig, board, seen, true);
  if (!found) throw InputError("too few boards: no part of the board is seen by two cameras");
  FloorFit fit;
  fit.board_by_rig = found->board_from_world.scale;
  fit.scaled = std::abs(fit.board_by_rig - 1) > kScaleTolerance;
  Similarity scaling;
  if (fit.scaled) scaling.scale = fit.board_by_rig;
  const Rig scaled = moved_rig(rig, scaling);
  const RigidTransform first = place(scaled, board, seen, false)->board_from_world.rigid.inverse();
  const Bundle bundle = adjusted(scaled, board, seen, first);
  fit.new_from_old = {scaling.scale, bundle.world_from_board.front().inverse()};
  fit.rig = moved_rig(rig, fit.new_from_old);
  const auto all = residuals(bundle);
  fit.rms_px = rms_of(all);
  fit.disagreement_deg =
      disagreement_deg(rig, board, seen, bundle.world_from_board.front().rotation.col(2));
  for (const Seen& s : seen) fit.cameras.push_back(s.camera);
  require_sense(fit);
  return fit;
}

}  // namespace v3d::calib
