#include "calib/rig/rig_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/boards/board_pose.h"
#include "calib/boards/view_selection.h"
#include "calib/lens/bundle_adjustment.h"
#include "calib/lens/rig_lenses.h"
#include "calib/parallel_for.h"
#include "calib/rig/board_initialization.h"
#include "calib/rig/lateness.h"
#include "calib/rig/rig_comparison.h"
#include "calib/rig/time_offset.h"

namespace v3d::calib {
namespace {

constexpr int kFewestBoards = 3;
constexpr double kOutlierFactor = 4;  // of the camera's median observation
constexpr double kAcceptableRmsPx = 1.0;
constexpr double kHopelessPx = 30;  // after the first adjustment: it shows something else
constexpr double kScaleTolerance = 0.02;
constexpr double kNoticeable = 0.02;  // of an instant

std::string names_of(const std::vector<CameraObservations>& cameras,
                     const std::vector<int>& group) {
  constexpr size_t kMost = 6;
  std::string text;
  for (size_t i = 0; i < std::min(kMost, group.size()); ++i) {
    text += (i > 0 ? ", " : "") + cameras[group[i]].name;
  }
  return text + (group.size() > kMost ? ", ..." : "");
}

void shift(CameraObservations& camera, int late) {
  std::map<int64_t, BoardObservation> in_step;
  for (auto& [instant, observation] : camera.observations) {
    in_step[instant - late] = std::move(observation);
  }
  camera.observations = std::move(in_step);
}

class RigFitter {
 public:
  RigFitter(const Board& board, const std::vector<CameraObservations>& cameras,
            const RigOptions& options)
      : board_(board), cameras_(cameras), options_(options) {}

  RigFitter(const RigFitter&) = delete;
  RigFitter& operator=(const RigFitter&) = delete;

  RigFit fit() {
    require_boards();
    lenses_ = fit_rig_lenses(board_, cameras_, options_.before, options_.threads);
    find_poses();
    put_in_step();
    result_.tree = spanning_tree(count(), result_.pairs);
    require_connection();
    place_boards();
    adjust_all();
    put_in_step_between();
    fill_result();
    require_layout();
    return std::move(result_);
  }

 private:
  int count() const { return static_cast<int>(cameras_.size()); }

  void require_boards() const {
    for (const CameraObservations& camera : cameras_) {
      if (std::ssize(camera.observations) >= kFewestBoards) continue;
      throw InputError(
          camera.name + ": too few boards: found in " + std::to_string(camera.observations.size()) +
          (camera.observations.size() == 1 ? " picture" : " pictures") +
          ", 20 are good: show it to " + camera.name + " and a neighbour at the same time");
    }
  }

  // --- places -----------------------------------------------------------------------------------

  void find_poses() {
    poses_.assign(cameras_.size(), {});
    parallel_for(options_.threads, count(), [&](int i) {
      poses_[i] = possible_poses(lenses_.lenses[i], board_, cameras_[i]);
    });
    result_.pairs = pair_poses(poses_);
  }

  void put_in_step() {
    const std::vector<int> late = instants_late(poses_, result_.pairs);
    late_.assign(late.begin(), late.end());
    if (std::all_of(late.begin(), late.end(), [](int l) { return l == 0; })) return;
    if (std::any_of(late.begin(), late.end(),
                    [&](int l) { return std::abs(l) > options_.most_late; })) {
      throw InputError(lateness_text(cameras_, late_) +
                       ": give --timestamps, or cut the videos to one beginning");
    }
    for (size_t i = 0; i < cameras_.size(); ++i) shift(cameras_[i], late[i]);
    find_poses();
  }

  void require_connection() const {
    const auto groups = connected_groups(count(), result_.pairs);
    if (groups.size() == 1) return;
    throw InputError("too few boards: " + names_of(cameras_, groups[1]) + " shares fewer than " +
                     std::to_string(kFewestAgreeing) + " views of the board with " +
                     names_of(cameras_, groups[0]) +
                     ": show it so that a camera of either side sees it at the same time");
  }

  /// And the cameras along the tree.
  void place_boards() {
    std::vector<RigidTransform> places(cameras_.size());
    for (const TreeEdge& edge : result_.tree.edges) {
      places[edge.to] = edge.to_from_from * places[edge.from];
    }
    std::vector<CameraModel> cameras;
    for (size_t i = 0; i < cameras_.size(); ++i) {
      cameras.push_back(with_pose(lenses_.lenses[i], places[i]));
    }
    PlacedBoards boards = calib::place_boards({board_, cameras_, poses_, result_.pairs},
                                              std::move(cameras), options_.most_instants);
    bundle_ = std::move(boards.bundle);
    instants_ = std::move(boards.instants);
  }

  // --- adjustment -------------------------------------------------------------------------------

  void adjust_all() {
    BundleOptions options;
    options.fixed_cameras = {result_.tree.root};
    options.threads = options_.threads;
    options.iterations = 30;
    adjust(bundle_, options);
    reject_observations(kHopelessPx);
    options.coefficients = lenses_.coefficients;
    for (int round = 0; round < 3; ++round) {
      adjust(bundle_, options);
      if (!reject_observations(kAcceptableRmsPx)) return;
    }
    adjust(bundle_, options);
  }

  /// What is left of lateness below an instant: every corner is moved to where it was at the
  /// instant itself, and everything is adjusted again.
  void put_in_step_between() {
    for (int round = 0; round < 6; ++round) {
      const std::vector<double> parts = parts_late();
      if (std::all_of(parts.begin(), parts.end(), [](double p) { return p == 0; })) return;
      for (CornerObservation& point : bundle_.observations) {
        point.pixel += parts[point.camera] * velocity_of(point).value_or(Eigen::Vector2d::Zero());
      }
      for (size_t i = 0; i < parts.size(); ++i) late_[i] += parts[i];
      adjust_all();
    }
  }

  std::optional<Eigen::Vector2d> velocity_of(const CornerObservation& point) const {
    return corner_velocity(cameras_[point.camera].observations, instants_[point.board],
                           point.corner);
  }

  std::vector<double> parts_late() const {
    const auto all = residuals(bundle_);
    std::vector<std::vector<MovingCorner>> moving(cameras_.size());
    for (size_t i = 0; i < all.size(); ++i) {
      const auto velocity = velocity_of(bundle_.observations[i]);
      if (velocity) moving[bundle_.observations[i].camera].push_back({*velocity, all[i]});
    }
    std::vector<double> parts;
    for (const auto& corners : moving) parts.push_back(part_late(corners));
    return parts;
  }

  /// Observations that fit far worse than their camera's others, and worse than `harmless_px`;
  /// boards that fewer than two cameras see then. True when there were any.
  bool reject_observations(double harmless_px) {
    std::map<std::pair<int, int>, std::vector<Eigen::Vector2d>> by_observation;
    const auto all = residuals(bundle_);
    for (size_t i = 0; i < all.size(); ++i) {
      by_observation[{bundle_.observations[i].camera, bundle_.observations[i].board}].push_back(
          all[i]);
    }
    std::vector<std::vector<double>> by_camera(cameras_.size());
    for (const auto& [key, some] : by_observation) by_camera[key.first].push_back(rms_of(some));
    std::set<std::pair<int, int>> bad;
    for (const auto& [key, some] : by_observation) {
      const double usual = upper_median(by_camera[key.first]);
      const double rms = rms_of(some);
      if (rms > std::max(harmless_px, kOutlierFactor * usual)) {
        bad.insert(key);
        note_rejected(key.first, instants_[key.second], rms, usual);
      }
    }
    if (bad.empty()) return false;
    std::erase_if(bundle_.observations, [&](const CornerObservation& p) {
      return bad.contains({p.camera, p.board});
    });
    drop_lonely_boards();
    require_all_connected();
    return true;
  }

  void note_rejected(int camera, int64_t instant, double rms, double usual) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "its corners miss by %.2f px, the camera's median picture by %.2f: blurred, "
                  "misread or of another instant",
                  rms, usual);
    result_.rejected.push_back({camera, instant, text});
  }

  void drop_lonely_boards() {
    std::vector<std::set<int>> seen_by(bundle_.world_from_board.size());
    for (const CornerObservation& p : bundle_.observations) seen_by[p.board].insert(p.camera);
    std::vector<int> renumbered(seen_by.size(), -1);
    std::vector<RigidTransform> boards;
    std::vector<int64_t> instants;
    for (size_t i = 0; i < seen_by.size(); ++i) {
      if (seen_by[i].size() < 2) continue;
      renumbered[i] = static_cast<int>(boards.size());
      boards.push_back(bundle_.world_from_board[i]);
      instants.push_back(instants_[i]);
    }
    std::erase_if(bundle_.observations,
                  [&](const CornerObservation& p) { return renumbered[p.board] < 0; });
    for (CornerObservation& p : bundle_.observations) p.board = renumbered[p.board];
    bundle_.world_from_board = std::move(boards);
    instants_ = std::move(instants);
  }

  void require_all_connected() const {
    std::vector<std::set<int>> boards(cameras_.size());
    for (const CornerObservation& p : bundle_.observations) boards[p.camera].insert(p.board);
    for (int i = 0; i < count(); ++i) {
      if (std::ssize(boards[i]) >= kFewestBoards) continue;
      throw InputError(cameras_[i].name +
                       ": its pictures of the board do not fit those of the "
                       "other cameras: is it swapped with another, out of sync, or was it moved "
                       "while the board was shown?");
    }
  }

  // --- result -----------------------------------------------------------------------------------

  void fill_result() {
    const auto all = residuals(bundle_);
    result_.rms_px = rms_of(all);
    for (int i = 0; i < count(); ++i) result_.cameras.push_back(describe_camera(i, all));
    const RigidTransform world_from_root = guess_world();
    for (int i = 0; i < count(); ++i) {
      result_.rig.push_back({cameras_[i].name, bundle_.cameras[i]});
    }
    result_.rig = moved_rig(result_.rig, {1, world_from_root});
    for (size_t i = 0; i < instants_.size(); ++i) {
      result_.world_from_board[instants_[i]] = world_from_root * bundle_.world_from_board[i];
    }
  }

  CameraFit describe_camera(int camera, const std::vector<Eigen::Vector2d>& all) const {
    CameraFit fit;
    std::vector<Eigen::Vector2d> own;
    std::set<int> boards;
    BoardObservation pixels;
    for (size_t i = 0; i < all.size(); ++i) {
      const CornerObservation& point = bundle_.observations[i];
      if (point.camera != camera) continue;
      own.push_back(all[i]);
      boards.insert(point.board);
      pixels.pixels.push_back(point.pixel);
      fit.residuals.push_back({point.pixel, all[i]});
    }
    const BoardObservation* every = &pixels;
    fit.rms_px = rms_of(own);
    fit.views = static_cast<int>(boards.size());
    fit.found = static_cast<int>(cameras_[camera].observations.size());
    fit.late = late_[camera];
    fit.coefficients = lenses_.coefficients[camera];
    fit.coverage = coverage(cameras_[camera].size, {&every, 1});
    fit.rejected = static_cast<int>(
        std::count_if(result_.rejected.begin(), result_.rejected.end(),
                      [&](const RejectedObservation& r) { return r.camera == camera; }));
    return fit;
  }

  /// Up is where the images have it, the origin is the point nearest to all optical axes.
  RigidTransform guess_world() const {
    Eigen::Vector3d up = Eigen::Vector3d::Zero(), sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const CameraModel& camera : bundle_.cameras) {
      up -= camera.cam_from_world().rotation.row(1).transpose();
      const Eigen::Vector3d axis = camera.viewing_direction();
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
      spread += across;
      sum += across * camera.center();
    }
    if (!(up.norm() > 1e-6)) up = Eigen::Vector3d::UnitZ();
    // Cameras that all look the same way meet nowhere: then the board tells.
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    for (const RigidTransform& board : bundle_.world_from_board) {
      origin += board * board_.centre() / static_cast<double>(bundle_.world_from_board.size());
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread);
    if (eigen.eigenvalues()[0] > 0.02 * static_cast<double>(bundle_.cameras.size())) {
      origin = spread.inverse() * sum;
    }
    RigidTransform turn;
    turn.rotation =
        Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    return turn * RigidTransform{Eigen::Matrix3d::Identity(), -origin};
  }

  void require_layout() const {
    if (!options_.before) return;
    const LayoutChange change = compare_layouts(result_.rig, *options_.before);
    if (change.swapped.size() == 1) {
      throw_swapped_cameras(change.swapped[0].first, change.swapped[0].second,
                            "each stands in the place of");
    }
    if (std::abs(change.scale - 1) > kScaleTolerance) {
      char text[200];
      std::snprintf(text, sizeof text,
                    "wrong board size: the cameras would stand %.3f times as far apart as before: "
                    "are the squares %.1f mm instead of %.1f?",
                    change.scale, 1000 * board_.square_m / change.scale, 1000 * board_.square_m);
      throw InputError(text);
    }
  }

  const Board& board_;
  std::vector<CameraObservations> cameras_;
  const RigOptions& options_;
  RigLenses lenses_;
  std::vector<CameraPoses> poses_;
  std::vector<double> late_;
  Bundle bundle_;
  std::vector<int64_t> instants_;  ///< of the bundle's boards
  RigFit result_;
};

}  // namespace

std::string lateness_text(const std::vector<CameraObservations>& cameras,
                          const std::vector<double>& late) {
  std::string text;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (std::abs(late[i]) < kNoticeable) continue;
    const double by = std::round(100 * std::abs(late[i])) / 100;
    char size[64];
    std::snprintf(size, sizeof size, " is %g %s %s", by, by == 1 ? "picture" : "pictures",
                  late[i] > 0 ? "late" : "early");
    text += (text.empty() ? "cameras out of sync: " : ", ") + cameras[i].name + size;
  }
  return text.empty() ? text : text + " against the others";
}

RigFit fit_rig(const Board& board, const std::vector<CameraObservations>& cameras,
               const RigOptions& options) {
  return RigFitter(board, cameras, options).fit();
}

}  // namespace v3d::calib
