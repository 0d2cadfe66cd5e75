#include "calib/rig/rig_fit.h"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/union_find.h"
#include "calib/boards/board.h"
#include "calib/lens/bundle_adjustment.h"
#include "calib/lens/lens_fit.h"
#include "calib/parallel_for.h"
#include "calib/rig/pair_poses.h"
#include "calib/rig/rig_alignment.h"
#include "calib/rig/time_offset.h"

namespace v3d::calib {
namespace {

constexpr int kMinBoards = 3;
constexpr double kOutlierFactor = 4;  // of the median RMS error of the camera
constexpr double kAcceptableRmsPx = 1.0;
constexpr double kGrossErrorPx = 30;  // after the first adjustment
constexpr double kScaleTolerance = 0.02;
constexpr double kMinReportedOffset = 0.02;  // instants

std::string names_of(const std::vector<CameraObservations>& cameras,
                     const std::vector<int>& group) {
  constexpr size_t kMaxNames = 6;
  std::string text;
  for (size_t i = 0; i < std::min(kMaxNames, group.size()); ++i) {
    text += (i > 0 ? ", " : "") + cameras[group[i]].name;
  }
  return text + (group.size() > kMaxNames ? ", ..." : "");
}

void shift_instants(CameraObservations& camera, int offset) {
  std::map<int64_t, BoardObservation> shifted;
  for (auto& [instant, observation] : camera.observations) {
    shifted[instant - offset] = std::move(observation);
  }
  camera.observations = std::move(shifted);
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
    for (CameraObservations& camera : cameras_) number_alike(board_, camera);
    lenses_ = fit_rig_lenses(board_, cameras_, options_.previous, options_.threads);
    find_poses();
    correct_whole_offsets();
    result_.tree = spanning_tree(count(), result_.pairs);
    require_connected_pairs();
    initialize_boards();
    adjust_all();
    correct_fractional_offsets();
    fill_result();
    compare_with_previous();
    return std::move(result_);
  }

 private:
  int count() const { return static_cast<int>(cameras_.size()); }

  void require_boards() const {
    for (const CameraObservations& camera : cameras_) {
      if (std::ssize(camera.observations) >= kMinBoards) continue;
      throw InputError(camera.name + ": too few boards: found in " +
                       std::to_string(camera.observations.size()) +
                       (camera.observations.size() == 1 ? " image" : " images") +
                       ", 20 are recommended: show the board to " + camera.name +
                       " and a neighbour at the same time");
    }
  }

  // --- poses ------------------------------------------------------------------------------------

  void find_poses() {
    poses_.assign(cameras_.size(), {});
    parallel_for(options_.threads, count(), [&](int i) {
      poses_[i] = candidate_poses(lenses_.lenses[i], board_, cameras_[i]);
    });
    result_.pairs = pair_poses(poses_);
  }

  void correct_whole_offsets() {
    const std::vector<int> offsets = whole_time_offsets(poses_, result_.pairs);
    time_offsets_.assign(offsets.begin(), offsets.end());
    if (std::all_of(offsets.begin(), offsets.end(), [](int l) { return l == 0; })) return;
    if (std::any_of(offsets.begin(), offsets.end(),
                    [&](int l) { return std::abs(l) > options_.max_time_offset; })) {
      const std::string& remedy = options_.time_offset_remedy;
      throw InputError(time_offset_text(cameras_, time_offsets_) +
                       (remedy.empty() ? "" : ": " + remedy));
    }
    for (size_t i = 0; i < cameras_.size(); ++i) shift_instants(cameras_[i], offsets[i]);
    find_poses();
  }

  void require_connected_pairs() const {
    const auto groups = connected_components(count(), result_.pairs);
    if (groups.size() > 1) throw_disconnected(groups[0], groups[1], "views");
  }

  [[noreturn]] void throw_disconnected(const std::vector<int>& group, const std::vector<int>& other,
                                       const std::string& views) const {
    throw InputError("too few boards: " + names_of(cameras_, other) +
                     (other.size() > 1 ? " share" : " shares") + " fewer than " +
                     std::to_string(kMinInliers) + " " + views + " of the board with " +
                     names_of(cameras_, group) +
                     ": show the board so that a camera of each group sees it at the same time");
  }

  /// Also sets the camera poses, along the spanning tree.
  void initialize_boards() {
    std::vector<RigidTransform> poses(cameras_.size());
    for (const TreeEdge& edge : result_.tree.edges) {
      poses[edge.to] = edge.to_from_from * poses[edge.from];
    }
    std::vector<CameraModel> cameras;
    for (size_t i = 0; i < cameras_.size(); ++i) {
      cameras.push_back(with_pose(lenses_.lenses[i], poses[i]));
    }
    InitialBoards boards = calib::initialize_boards({board_, cameras_, poses_, result_.pairs},
                                                    std::move(cameras), options_.max_instants);
    bundle_ = std::move(boards.bundle);
    instants_ = std::move(boards.instants);
    turned_ = std::move(boards.turned);
  }

  // --- adjustment -------------------------------------------------------------------------------

  void adjust_all() {
    BundleOptions options;
    options.fixed_cameras = {result_.tree.root};
    options.threads = options_.threads;
    options.iterations = 30;
    adjust(bundle_, options);
    reject_observations(kGrossErrorPx);
    options.coefficients = lenses_.coefficients;
    for (int iteration = 0; iteration < 3; ++iteration) {
      adjust(bundle_, options);
      if (!reject_observations(kAcceptableRmsPx)) return;
    }
    adjust(bundle_, options);
  }

  /// Corrects time offsets below one instant: moves each corner to its position at the instant and
  /// repeats the adjustment.
  void correct_fractional_offsets() {
    for (int iteration = 0; iteration < 6; ++iteration) {
      const std::vector<double> fractions = fractional_time_offsets();
      if (std::all_of(fractions.begin(), fractions.end(), [](double p) { return p == 0; })) return;
      for (CornerObservation& point : bundle_.observations) {
        point.pixel +=
            fractions[point.camera] * velocity_of(point).value_or(Eigen::Vector2d::Zero());
      }
      for (size_t i = 0; i < fractions.size(); ++i) time_offsets_[i] += fractions[i];
      adjust_all();
    }
  }

  std::optional<Eigen::Vector2d> velocity_of(const CornerObservation& point) const {
    const int64_t instant = instants_[point.board];
    const bool is_turned = turned_.contains({point.camera, instant});
    return corner_velocity(cameras_[point.camera].observations, instant,
                           is_turned ? board_.corners() - 1 - point.corner : point.corner);
  }

  std::vector<double> fractional_time_offsets() const {
    const auto all = residuals(bundle_);
    std::vector<std::vector<MovingCorner>> moving(cameras_.size());
    for (size_t i = 0; i < all.size(); ++i) {
      const auto velocity = velocity_of(bundle_.observations[i]);
      if (velocity) moving[bundle_.observations[i].camera].push_back({*velocity, all[i]});
    }
    std::vector<double> fractions;
    for (const auto& corners : moving) fractions.push_back(fractional_time_offset(corners));
    return fractions;
  }

  /// Removes observations whose RMS error exceeds `acceptable_px` and is far above the camera's
  /// median, and then boards with fewer than two cameras. Returns whether there were any.
  bool reject_observations(double acceptable_px) {
    std::map<std::pair<int, int>, std::vector<Eigen::Vector2d>> by_observation;
    const auto all = residuals(bundle_);
    for (size_t i = 0; i < all.size(); ++i) {
      by_observation[{bundle_.observations[i].camera, bundle_.observations[i].board}].push_back(
          all[i]);
    }
    std::vector<std::vector<double>> by_camera(cameras_.size());
    for (const auto& [key, some] : by_observation) by_camera[key.first].push_back(rms_of(some));
    std::set<std::pair<int, int>> outliers;
    for (const auto& [key, some] : by_observation) {
      const double median = upper_median(by_camera[key.first]);
      const double rms = rms_of(some);
      if (rms > std::max(acceptable_px, kOutlierFactor * median)) {
        outliers.insert(key);
        record_rejected(key.first, instants_[key.second], rms, median);
      }
    }
    if (outliers.empty()) return false;
    std::erase_if(bundle_.observations, [&](const CornerObservation& p) {
      return outliers.contains({p.camera, p.board});
    });
    drop_single_view_boards();
    require_all_connected();
    return true;
  }

  void record_rejected(int camera, int64_t instant, double rms, double median) {
    const std::string text = fmt::format(
        "its RMS residual is {:.2f} px, the camera's median {:.2f} px: blurred, misdetected "
        "or of another instant",
        rms, median);
    result_.rejected.push_back({camera, instant, text});
  }

  void drop_single_view_boards() {
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
      if (std::ssize(boards[i]) >= kMinBoards) continue;
      throw InputError(
          cameras_[i].name +
          ": its images of the board do not agree with those of the other cameras: is it "
          "swapped with another camera, out of sync, or was it moved while the board "
          "was shown?");
    }
    const std::vector<bool> connected = connected_to_root();
    std::vector<int> group, others;
    for (int i = 0; i < count(); ++i) (connected[i] ? group : others).push_back(i);
    if (!others.empty()) throw_disconnected(group, others, "agreeing views");
  }

  /// By camera, whether boards of the bundle determine its pose relative to the fixed camera.
  /// Groups of cameras are united where they share kMinInliers boards.
  std::vector<bool> connected_to_root() const {
    UnionFind groups;
    groups.reset(cameras_.size());
    for (bool united = true; united;) {
      united = false;
      for (const auto& [pair, boards] : shared_boards(groups)) {
        if (boards >= kMinInliers) united |= groups.unite(pair.first, pair.second);
      }
    }
    std::vector<bool> connected;
    for (int i = 0; i < count(); ++i) {
      connected.push_back(groups.find(i) == groups.find(result_.tree.root));
    }
    return connected;
  }

  /// The number of boards of the bundle that two groups of cameras both observe.
  std::map<std::pair<uint32_t, uint32_t>, int> shared_boards(UnionFind& groups) const {
    std::vector<std::set<uint32_t>> seen_by(bundle_.world_from_board.size());
    for (const CornerObservation& p : bundle_.observations) {
      seen_by[p.board].insert(groups.find(p.camera));
    }
    std::map<std::pair<uint32_t, uint32_t>, int> shared;
    for (const std::set<uint32_t>& seen : seen_by) {
      for (auto a = seen.begin(); a != seen.end(); ++a) {
        for (auto b = std::next(a); b != seen.end(); ++b) ++shared[{*a, *b}];
      }
    }
    return shared;
  }

  // --- result -----------------------------------------------------------------------------------

  void fill_result() {
    const auto all = residuals(bundle_);
    result_.rms_px = rms_of(all);
    for (int i = 0; i < count(); ++i) result_.cameras.push_back(fit_of_camera(i, all));
    const RigidTransform world_from_root = find_world_from_root();
    for (int i = 0; i < count(); ++i) {
      result_.rig.push_back({cameras_[i].name, bundle_.cameras[i], previous_colour(i)});
    }
    result_.rig = transformed_rig(result_.rig, {1, world_from_root});
    for (size_t i = 0; i < instants_.size(); ++i) {
      result_.world_from_board[instants_[i]] = world_from_root * bundle_.world_from_board[i];
    }
  }

  /// Where the previous calibration is given, it has every camera, or fit_rig_lenses() has thrown.
  ColourResponse previous_colour(int camera) const {
    if (!options_.previous) return {};
    const int index = find_camera(*options_.previous, cameras_[camera].name);
    return (*options_.previous)[static_cast<size_t>(index)].colour;
  }

  CameraFit fit_of_camera(int camera, const std::vector<Eigen::Vector2d>& all) const {
    CameraFit fit;
    std::vector<Eigen::Vector2d> own_residuals;
    std::set<int> boards;
    BoardObservation pixels;
    for (size_t i = 0; i < all.size(); ++i) {
      const CornerObservation& point = bundle_.observations[i];
      if (point.camera != camera) continue;
      own_residuals.push_back(all[i]);
      boards.insert(point.board);
      pixels.pixels.push_back(point.pixel);
      fit.residuals.push_back({point.pixel, all[i]});
    }
    const BoardObservation* every = &pixels;
    fit.rms_px = rms_of(own_residuals);
    fit.views = static_cast<int>(boards.size());
    fit.found = static_cast<int>(cameras_[camera].observations.size());
    fit.time_offset = time_offsets_[camera];
    fit.coefficients = lenses_.coefficients[camera];
    fit.focal_deviation = lenses_.focal_deviations[camera];
    fit.coverage = coverage(cameras_[camera].size, {&every, 1});
    fit.rejected = static_cast<int>(
        std::count_if(result_.rejected.begin(), result_.rejected.end(),
                      [&](const RejectedObservation& r) { return r.camera == camera; }));
    return fit;
  }

  /// Up is the mean upward direction of the images, the origin is the point nearest to all optical
  /// axes.
  RigidTransform find_world_from_root() const {
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
    // Parallel optical axes have no nearest point; then use the mean board position.
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

  void compare_with_previous() const {
    if (!options_.previous) return;
    const RigDifference difference = compare_rigs(result_.rig, *options_.previous);
    if (difference.swapped.size() == 1) {
      throw_swapped_cameras(difference.swapped[0].first, difference.swapped[0].second,
                            "each is at the position of");
    }
    if (difference.same_shape && std::abs(difference.scale - 1) > kScaleTolerance) {
      throw InputError(fmt::format(
          "wrong board size: the distances between the cameras would be {:.3f} times those of "
          "the previous calibration: are the squares {:.1f} mm instead of {:.1f}? If the "
          "cameras were moved apart instead, set each translation of the previous calibration to "
          "[0, 0, 0]",
          difference.scale, 1000 * board_.square_m / difference.scale, 1000 * board_.square_m));
    }
  }

  const Board& board_;
  std::vector<CameraObservations> cameras_;
  const RigOptions& options_;
  RigLenses lenses_;
  std::vector<CandidatePoses> poses_;
  std::vector<double> time_offsets_;
  Bundle bundle_;
  std::vector<int64_t> instants_;             ///< of the bundle's boards
  std::set<std::pair<int, int64_t>> turned_;  ///< see InitialBoards
  RigFit result_;
};

}  // namespace

std::string time_offset_text(const std::vector<CameraObservations>& cameras,
                             const std::vector<double>& offsets) {
  std::string text;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (std::abs(offsets[i]) < kMinReportedOffset) continue;
    const double by = std::round(100 * std::abs(offsets[i])) / 100;
    const std::string size = fmt::format(" is {:g} {} {}", by, by == 1 ? "image" : "images",
                                         offsets[i] > 0 ? "late" : "early");
    text += (text.empty() ? "cameras out of sync: " : ", ") + cameras[i].name + size;
  }
  return text.empty() ? text : text + " relative to the others";
}

RigFit fit_rig(const Board& board, const std::vector<CameraObservations>& cameras,
               const RigOptions& options) {
  return RigFitter(board, cameras, options).fit();
}

Rig initial_rig(const std::vector<std::string>& names, ImageSize size, double horizontal_fov_deg,
                const Box& space) {
  const double half_width = 0.5 * size.width;
  const double half_height = 0.5 * size.height;
  const double focal = half_width / std::tan(horizontal_fov_deg * std::numbers::pi / 360);
  Eigen::Matrix3d matrix;
  matrix << focal, 0, half_width, 0, focal, half_height, 0, 0, 1;
  // The bounding sphere of the space touches the nearest borders of the image.
  const double narrowest = std::atan(std::min(half_width, half_height) / focal);
  const double distance = 0.5 * space.size().norm() / std::sin(narrowest);
  Rig rig;
  for (size_t i = 0; i < names.size(); ++i) {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(names.size());
    const Eigen::Vector3d eye =
        space.center() + distance * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    rig.push_back({names[i], CameraModel(size, matrix, {}, look_at(eye, space.center())), {}});
  }
  return rig;
}

}  // namespace v3d::calib
