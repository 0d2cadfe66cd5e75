#include "calib/lens/lens_fit.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/image/image.h"
#include "calib/boards/board.h"
#include "calib/lens/bundle_adjustment.h"
#include "calib/parallel_for.h"

namespace v3d::calib {
namespace {

constexpr std::array kModels = {4, 5, 8};
constexpr int kFolds = 5;
constexpr int kFoldIterations = 10;  // few, because the fit to all views is a close start
// More coefficients must reduce the prediction error to this factor, or they only fit noise.
constexpr double kMinImprovement = 0.95;
constexpr double kOutlierFactor = 3;  // of the median view
constexpr double kAcceptableRmsPx = 0.5;
// Standard deviations of the focal length, as shares of it.
constexpr double kMaxFocalDeviation = 0.05;
constexpr double kGoodFocalDeviation = 0.01;
constexpr double kMaxRmsPx = 1;
constexpr char kTiltAdvice[] = "tilt the board by 30 degrees and more in all directions";

/// A lens, and the poses of the board in some views.
struct Fit {
  CameraModel lens;
  std::vector<int> views;
  std::vector<RigidTransform> cam_from_board;  ///< by index in `views`
};

CameraModel with_coefficients(const CameraModel& lens, int count) {
  Distortion distortion = lens.distortion();
  std::fill(distortion.begin() + count, distortion.end(), 0.0);
  return {lens.size(), lens.matrix(), distortion, lens.cam_from_world()};
}

class LensFitter {
 public:
  LensFitter(const Board& board, ImageSize size, std::span<const LensView> views)
      : board_(board), size_(size), views_(views) {}

  /// The views for which board_poses() finds a pose.
  Fit with_initial_poses(const CameraModel& lens, const std::vector<int>& views) const {
    Fit fit{lens, {}, {}};
    for (const int view : views) {
      const auto poses = board_poses(lens, board_, views_[view].observation);
      if (poses.empty()) continue;
      fit.views.push_back(view);
      fit.cam_from_board.push_back(poses.front().cam_from_board);
    }
    return fit;
  }

  /// `coefficients` 0: adjusts only the boards; else sets all further coefficients to 0.
  void adjust_fit(Fit& fit, int coefficients, int iterations = 60) const {
    if (fit.views.empty()) return;
    if (coefficients > 0) fit.lens = with_coefficients(fit.lens, coefficients);
    Bundle bundle{board_, {fit.lens}, fit.cam_from_board, {}};
    for (size_t i = 0; i < fit.views.size(); ++i) {
      const BoardObservation& observation = views_[fit.views[i]].observation;
      for (int k = 0; k < observation.count(); ++k) {
        bundle.observations.push_back(
            {0, static_cast<int>(i), observation.corners[k], observation.pixels[k]});
      }
    }
    BundleOptions options;
    options.coefficients = {coefficients};
    options.iterations = iterations;
    options.threads = 1;  // fit_rig_lenses() runs one camera per thread
    adjust(bundle, options);
    fit.lens = bundle.cameras.front();
    fit.cam_from_board = bundle.world_from_board;
  }

  /// A fit without initial values. Board poses are estimated again in each iteration, because the
  /// tilt of a board is ambiguous until the lens is known.
  Fit from_scratch(const std::vector<int>& views) const {
    std::vector<const BoardObservation*> observations;
    for (const int view : views) observations.push_back(&views_[view].observation);
    CameraModel lens(size_, initial_camera_matrix(board_, size_, observations), {}, {});
    Fit fit;
    for (int iteration = 0; iteration < 3; ++iteration) {
      fit = with_initial_poses(lens, views);
      adjust_fit(fit, 4);
      lens = fit.lens;
    }
    return fit;
  }

  std::vector<Eigen::Vector2d> residuals_of(const Fit& fit, size_t place) const {
    return residuals(fit.lens, board_, fit.cam_from_board[place],
                     views_[fit.views[place]].observation);
  }

  double rms_of_view(const Fit& fit, size_t place) const {
    return rms_of(residuals_of(fit, place));
  }

  double rms_of_fit(const Fit& fit) const {
    std::vector<Eigen::Vector2d> all;
    for (size_t i = 0; i < fit.views.size(); ++i) {
      const auto some = residuals_of(fit, i);
      all.insert(all.end(), some.begin(), some.end());
    }
    return rms_of(all);
  }

  double focal_deviation_px(const Fit& fit, int coefficients) const {
    std::vector<PosedObservation> posed;
    for (size_t i = 0; i < fit.views.size(); ++i) {
      posed.push_back({&views_[fit.views[i]].observation, fit.cam_from_board[i]});
    }
    return calib::focal_deviation_px(fit.lens, coefficients, board_, posed,
                                     BundleOptions{}.robust_px);
  }

  const LensView& view(int index) const { return views_[index]; }
  const Board& board() const { return board_; }

 private:
  const Board& board_;
  ImageSize size_;
  std::span<const LensView> views_;
};

std::string describe_outlier(double rms, double median) {
  return fmt::format(
      "its RMS residual is {:.2f} px, the median of all images {:.2f} px: blurred, partly "
      "hidden or misdetected",
      rms, median);
}

/// Records the views of `selected` that the fit left out, because no pose of the board fits them.
void record_without_pose(const LensFitter& fitter, const std::vector<int>& selected, const Fit& fit,
                         std::vector<RejectedView>& rejected) {
  for (const int view : selected) {
    if (std::find(fit.views.begin(), fit.views.end(), view) != fit.views.end()) continue;
    rejected.push_back(
        {view, fmt::format("no pose of the board fits its {} corners: on one line or misdetected",
                           fitter.view(view).observation.count())});
  }
}

/// Removes views that fit much worse than the median view. Returns whether there were any.
bool reject_outliers(const LensFitter& fitter, Fit& fit, std::vector<RejectedView>& rejected) {
  std::vector<double> rms;
  for (size_t i = 0; i < fit.views.size(); ++i) rms.push_back(fitter.rms_of_view(fit, i));
  const double median = upper_median(rms);
  Fit kept{fit.lens, {}, {}};
  for (size_t i = 0; i < fit.views.size(); ++i) {
    if (rms[i] > std::max(kAcceptableRmsPx, kOutlierFactor * median)) {
      rejected.push_back({fit.views[i], describe_outlier(rms[i], median)});
    } else {
      kept.views.push_back(fit.views[i]);
      kept.cam_from_board.push_back(fit.cam_from_board[i]);
    }
  }
  const bool any = kept.views.size() < fit.views.size();
  fit = std::move(kept);
  return any;
}

/// The part of a fit with the views of one fold (`inside`), or with all other views.
Fit part_of(const Fit& fit, int fold, bool inside) {
  Fit part{fit.lens, {}, {}};
  for (size_t i = 0; i < fit.views.size(); ++i) {
    if ((static_cast<int>(i) % kFolds == fold) != inside) continue;
    part.views.push_back(fit.views[i]);
    part.cam_from_board.push_back(fit.cam_from_board[i]);
  }
  return part;
}

struct Validation {
  Fit fit;  ///< of all views
  LensTrial trial;
};

/// Predicts each fifth of the views by a lens fitted to the others. Only the board poses of the
/// held-out views are fitted.
Validation cross_validate(const LensFitter& fitter, Fit fit, int coefficients) {
  double squares = 0;
  int64_t corners = 0;
  for (int fold = 0; fold < kFolds; ++fold) {
    Fit others = part_of(fit, fold, false);
    fitter.adjust_fit(others, coefficients, kFoldIterations);
    Fit held_out = part_of(fit, fold, true);
    held_out.lens = others.lens;
    fitter.adjust_fit(held_out, 0, kFoldIterations);
    for (size_t i = 0; i < held_out.views.size(); ++i) {
      for (const auto& residual : fitter.residuals_of(held_out, i)) {
        squares += residual.squaredNorm();
        ++corners;
      }
    }
  }
  const double rms = std::sqrt(squares / static_cast<double>(std::max<int64_t>(1, corners)));
  return {std::move(fit), {coefficients, rms}};
}

/// The smallest model that predicts about as well as the best one.
size_t best_of(const std::vector<Validation>& tried) {
  size_t best = 0;
  for (size_t i = 1; i < tried.size(); ++i) {
    if (tried[i].trial.held_out_rms_px < kMinImprovement * tried[best].trial.held_out_rms_px)
      best = i;
  }
  return best;
}

void select_model(const LensFitter& fitter, const LensOptions& options, Fit& fit, LensFit& result) {
  std::vector<Validation> tried;
  for (const int coefficients : kModels) {
    if (options.coefficients != 0 && options.coefficients != coefficients) continue;
    Fit start = fit;
    fitter.adjust_fit(start, coefficients);
    tried.push_back(cross_validate(fitter, std::move(start), coefficients));
    result.trials.push_back(tried.back().trial);
  }
  Validation& best = tried[best_of(tried)];
  result.coefficients = best.trial.coefficients;
  fit = std::move(best.fit);
}

void require_enough_views(const std::string& camera, size_t usable, size_t found) {
  if (usable >= kMinLensViews) return;
  std::string text = camera + ": too few boards: " + std::to_string(usable) + " usable " +
                     (usable == 1 ? "image" : "images");
  if (found > usable) text += " of the " + std::to_string(found) + " with a detected board";
  throw InputError(
      text + ", at least " + std::to_string(kMinLensViews) +
      " are needed, 20 are recommended: show the board in all parts of the image, near "
      "and far, tilted in all directions");
}

std::vector<int> selected_views(const Board& board, ImageSize size, std::span<const LensView> views,
                                int max_views) {
  std::vector<const BoardObservation*> observations;
  for (const LensView& view : views) observations.push_back(&view.observation);
  return observations.empty() ? std::vector<int>()
                              : select_views(board, size, observations, max_views);
}

void fill_result(const LensFitter& fitter, const Fit& fit, LensFit& result) {
  result.lens = fit.lens;
  result.rms_px = fitter.rms_of_fit(fit);
  result.focal_deviation_px = fitter.focal_deviation_px(fit, result.coefficients);
  for (size_t i = 0; i < fit.views.size(); ++i) {
    result.fitted.push_back({fit.views[i], fitter.rms_of_view(fit, i), fit.cam_from_board[i],
                             fitter.residuals_of(fit, i)});
  }
}

/// Distance and focal length cannot be separated where all boards are parallel to the image: such a
/// fit is perfect, with any focal length.
void require_known_focal_length(const std::string& camera, const LensFit& fit) {
  if (fit.focal_deviation() <= kMaxFocalDeviation) return;
  const std::string found = fmt::format("{:.0f} px, with a standard deviation of {:.0f} px",
                                        fit.lens.matrix()(0, 0), fit.focal_deviation_px);
  throw InputError(camera + ": the boards do not determine the focal length (" + found +
                   "): " + kTiltAdvice);
}

// --- all lenses of a rig

constexpr double kSuspiciousRmsPx = 1.0;

LensFit fit_own_lens(const Board& board, const CameraObservations& camera) {
  std::vector<LensView> views;
  for (const auto& [instant, observation] : camera.observations) {
    views.push_back({std::to_string(instant), observation});
  }
  return fit_lens(camera.name, board, camera.size, views, {});
}

CameraModel previous_lens(const Rig& previous, const CameraObservations& camera) {
  const int index = find_camera(previous, camera.name);
  if (index < 0) throw InputError("the previous calibration has no camera " + camera.name);
  const CameraModel& lens = previous[static_cast<size_t>(index)].model;
  if (!(lens.size() == camera.size)) {
    throw InputError(camera.name + ": its images are " + format_size(camera.size) +
                     ", but its lens was calibrated at " + format_size(lens.size()));
  }
  return with_pose(lens, {});
}

/// Median RMS residual of a sample of the camera's observations through `lens`, pixels.
double median_rms(const CameraModel& lens, const Board& board, const CameraObservations& camera) {
  std::vector<double> rms;
  const size_t step = 1 + camera.observations.size() / 20;
  size_t position = 0;
  for (const auto& [instant, observation] : camera.observations) {
    if (position++ % step != 0) continue;
    const auto poses = board_poses(lens, board, observation);
    if (!poses.empty()) rms.push_back(poses.front().rms_px);
  }
  return rms.empty() ? 1e9 : upper_median(rms);
}

void require_unswapped_lenses(const Board& board, const std::vector<CameraObservations>& cameras,
                              const std::vector<CameraModel>& lenses) {
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      if (!(cameras[a].size == cameras[b].size)) continue;
      const double own_a = median_rms(lenses[a], board, cameras[a]);
      const double own_b = median_rms(lenses[b], board, cameras[b]);
      const double other_a = median_rms(lenses[b], board, cameras[a]);
      const double other_b = median_rms(lenses[a], board, cameras[b]);
      if (2 * other_a < own_a && 2 * other_b < own_b && std::min(own_a, own_b) > kSuspiciousRmsPx) {
        throw_swapped_cameras(cameras[a].name, cameras[b].name,
                              "the images of each fit the lens of");
      }
    }
  }
}

}  // namespace

LensFit fit_lens(const std::string& camera, const Board& board, ImageSize size,
                 std::span<const LensView> views, const LensOptions& options) {
  const std::vector<int> selected = selected_views(board, size, views, options.max_views);
  require_enough_views(camera, selected.size(), views.size());
  LensFit result;
  result.unneeded = static_cast<int>(views.size() - selected.size());
  const LensFitter fitter(board, size, views);
  Fit fit = fitter.from_scratch(selected);
  record_without_pose(fitter, selected, fit, result.rejected);
  require_enough_views(camera, fit.views.size(), views.size());
  for (int iteration = 0; iteration < 4; ++iteration) {
    fitter.adjust_fit(fit, 5);
    if (!reject_outliers(fitter, fit, result.rejected)) break;
    require_enough_views(camera, fit.views.size(), views.size());
  }
  select_model(fitter, options, fit, result);
  if (reject_outliers(fitter, fit, result.rejected)) {
    require_enough_views(camera, fit.views.size(), views.size());
    fitter.adjust_fit(fit, result.coefficients);
  }
  fill_result(fitter, fit, result);
  require_known_focal_length(camera, result);
  return result;
}

std::string focal_weakness(const std::string& camera, double focal_deviation) {
  if (focal_deviation <= kGoodFocalDeviation) return {};
  return camera + ": its own boards determine its focal length only to " +
         fmt::format("{:.1f} % (1 sigma): ", 100 * focal_deviation) + kTiltAdvice;
}

std::vector<std::string> find_weaknesses(const std::string& camera, const LensFit& fit) {
  std::vector<std::string> weaknesses;
  if (fit.rms_px > kMaxRmsPx) {
    const std::string text = fmt::format(
        " has an RMS residual of {:.1f} px, expected at most {:.0f}: is the board flat, ",
        fit.rms_px, kMaxRmsPx);
    weaknesses.push_back(camera + text +
                         "are its squares square, are the images sharp? Fisheye lenses do not fit");
  }
  std::string focal = focal_weakness(camera, fit.focal_deviation());
  if (!focal.empty()) weaknesses.push_back(std::move(focal));
  return weaknesses;
}

RigLenses fit_rig_lenses(const Board& board, const std::vector<CameraObservations>& cameras,
                         const std::optional<Rig>& previous, int threads) {
  RigLenses found{std::vector<CameraModel>(cameras.size()), std::vector<int>(cameras.size(), 0),
                  std::vector<double>(cameras.size(), 0.0)};
  if (previous) {
    for (size_t i = 0; i < cameras.size(); ++i)
      found.lenses[i] = previous_lens(*previous, cameras[i]);
    require_unswapped_lenses(board, cameras, found.lenses);
    return found;
  }
  parallel_for(threads, static_cast<int>(cameras.size()), [&](int i) {
    const LensFit fit = fit_own_lens(board, cameras[i]);
    found.lenses[i] = fit.lens;
    found.coefficients[i] = fit.coefficients;
    found.focal_deviations[i] = fit.focal_deviation();
  });
  return found;
}

void throw_swapped_cameras(const std::string& a, const std::string& b,
                           const std::string& evidence) {
  throw InputError("swapped cameras: " + a + " and " + b + ": " + evidence +
                   " the other: exchange their cables, addresses or files");
}

}  // namespace v3d::calib
