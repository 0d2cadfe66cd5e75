#include "calib/lens/lens_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/boards/board_pose.h"
#include "calib/boards/view_selection.h"
#include "calib/lens/bundle_adjustment.h"

namespace v3d::calib {
namespace {

constexpr std::array kModels = {4, 5, 8};
constexpr int kFolds = 5;
constexpr int kFoldIterations = 10;  // from the fit to all views, which is near
// More coefficients must foretell so much better, or they only follow the noise.
constexpr double kWorthMore = 0.95;
constexpr double kOutlierFactor = 3;  // of the median view
constexpr double kHarmlessPx = 0.5;

/// A lens and where the boards of some views stood before it.
struct Fit {
  CameraModel lens;
  std::vector<int> views;
  std::vector<RigidTransform> poses;  ///< by place in `views`
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

  /// Views of which `lens` knows no pose are left out.
  Fit posed(const CameraModel& lens, const std::vector<int>& views) const {
    Fit fit{lens, {}, {}};
    for (const int view : views) {
      const auto poses = board_poses(lens, board_, views_[view].sighting);
      if (poses.empty()) continue;
      fit.views.push_back(view);
      fit.poses.push_back(poses.front().cam_from_board);
    }
    return fit;
  }

  /// `coefficients` 0: only the boards move; else the lens has no others.
  void improve(Fit& fit, int coefficients, int iterations = 60) const {
    if (fit.views.empty()) return;
    if (coefficients > 0) fit.lens = with_coefficients(fit.lens, coefficients);
    Bundle bundle{board_, {fit.lens}, fit.poses, {}};
    for (size_t i = 0; i < fit.views.size(); ++i) {
      const BoardSighting& sighting = views_[fit.views[i]].sighting;
      for (int k = 0; k < sighting.count(); ++k) {
        bundle.points.push_back({0, static_cast<int>(i), sighting.corners[k], sighting.pixels[k]});
      }
    }
    BundleOptions options;
    options.coefficients = {coefficients};
    options.iterations = iterations;
    options.threads = 1;  // callers have several cameras
    adjust(bundle, options);
    fit.lens = bundle.cameras.front();
    fit.poses = bundle.world_from_board;
  }

  /// From nothing. Which way a board leans is known only once the lens is, so it is asked again.
  Fit from_scratch(const std::vector<int>& views) const {
    std::vector<const BoardSighting*> sightings;
    for (const int view : views) sightings.push_back(&views_[view].sighting);
    CameraModel lens(size_, first_camera_matrix(board_, size_, sightings), {}, {});
    Fit fit;
    for (int round = 0; round < 3; ++round) {
      fit = posed(lens, views);
      improve(fit, 4);
      lens = fit.lens;
    }
    return fit;
  }

  std::vector<Eigen::Vector2d> misses_of(const Fit& fit, size_t place) const {
    return misses(fit.lens, board_, fit.poses[place], views_[fit.views[place]].sighting);
  }

  double rms_of_view(const Fit& fit, size_t place) const { return rms_of(misses_of(fit, place)); }

  double rms_of_fit(const Fit& fit) const {
    std::vector<Eigen::Vector2d> all;
    for (size_t i = 0; i < fit.views.size(); ++i) {
      const auto some = misses_of(fit, i);
      all.insert(all.end(), some.begin(), some.end());
    }
    return rms_of(all);
  }

  const LensView& view(int index) const { return views_[index]; }
  const Board& board() const { return board_; }

 private:
  const Board& board_;
  ImageSize size_;
  std::span<const LensView> views_;
};

std::string outlier_reason(double rms, double usual) {
  char text[160];
  std::snprintf(text, sizeof text,
                "its corners miss by %.2f px, those of the median picture by %.2f: blurred, "
                "half hidden or misread",
                rms, usual);
  return text;
}

/// Takes the views out that fit much worse than most; true when there were any.
bool reject_outliers(const LensFitter& fitter, Fit& fit, std::vector<RejectedView>& rejected) {
  std::vector<double> rms;
  for (size_t i = 0; i < fit.views.size(); ++i) rms.push_back(fitter.rms_of_view(fit, i));
  const double usual = upper_median(rms);
  Fit kept{fit.lens, {}, {}};
  for (size_t i = 0; i < fit.views.size(); ++i) {
    if (rms[i] > std::max(kHarmlessPx, kOutlierFactor * usual)) {
      rejected.push_back({fit.views[i], outlier_reason(rms[i], usual)});
    } else {
      kept.views.push_back(fit.views[i]);
      kept.poses.push_back(fit.poses[i]);
    }
  }
  const bool any = kept.views.size() < fit.views.size();
  fit = std::move(kept);
  return any;
}

/// The views of a fold, or all others, as they stand.
Fit part_of(const Fit& fit, int fold, bool inside) {
  Fit part{fit.lens, {}, {}};
  for (size_t i = 0; i < fit.views.size(); ++i) {
    if ((static_cast<int>(i) % kFolds == fold) != inside) continue;
    part.views.push_back(fit.views[i]);
    part.poses.push_back(fit.poses[i]);
  }
  return part;
}

struct Validation {
  Fit fit;  ///< to all views
  LensTrial trial;
  double focal_spread_px = 0;
};

/// Every fifth of the views is foretold by a lens fitted to the others: only the board's place in
/// the held-out picture is fitted.
Validation cross_validate(const LensFitter& fitter, Fit fit, int coefficients) {
  double squares = 0, focal = 0, focal_squares = 0;
  int64_t corners = 0;
  for (int fold = 0; fold < kFolds; ++fold) {
    Fit others = part_of(fit, fold, false);
    fitter.improve(others, coefficients, kFoldIterations);
    Fit held_out = part_of(fit, fold, true);
    held_out.lens = others.lens;
    fitter.improve(held_out, 0, kFoldIterations);
    for (size_t i = 0; i < held_out.views.size(); ++i) {
      for (const auto& miss : fitter.misses_of(held_out, i)) {
        squares += miss.squaredNorm();
        ++corners;
      }
    }
    const double fx = others.lens.matrix()(0, 0);
    focal += fx / kFolds;
    focal_squares += fx * fx / kFolds;
  }
  const double rms = std::sqrt(squares / static_cast<double>(std::max<int64_t>(1, corners)));
  const double spread = std::sqrt(std::max(0.0, focal_squares - focal * focal));
  return {std::move(fit), {coefficients, rms}, spread};
}

/// The smallest model that foretells as well as any.
size_t best_of(const std::vector<Validation>& tried) {
  size_t best = 0;
  for (size_t i = 1; i < tried.size(); ++i) {
    if (tried[i].trial.held_out_rms_px < kWorthMore * tried[best].trial.held_out_rms_px) best = i;
  }
  return best;
}

void choose_model(const LensFitter& fitter, const LensOptions& options, Fit& fit, LensFit& result) {
  std::vector<Validation> tried;
  for (const int coefficients : kModels) {
    if (options.coefficients != 0 && options.coefficients != coefficients) continue;
    Fit start = fit;
    fitter.improve(start, coefficients);
    tried.push_back(cross_validate(fitter, std::move(start), coefficients));
    result.trials.push_back(tried.back().trial);
  }
  Validation& best = tried[best_of(tried)];
  result.coefficients = best.trial.coefficients;
  result.focal_spread_px = best.focal_spread_px;
  fit = std::move(best.fit);
}

void require_views(const std::string& camera, size_t usable, size_t found) {
  if (usable >= kFewestLensViews) return;
  std::string text = camera + ": too few boards: " + std::to_string(usable) + " usable " +
                     (usable == 1 ? "picture" : "pictures");
  if (found > usable) text += " of the " + std::to_string(found) + " in which it was found";
  throw InputError(text + ", at least " + std::to_string(kFewestLensViews) +
                   " are needed and 20 are good: show the board in all parts of the image, near "
                   "and far, leaning to every side");
}

std::vector<int> chosen_views(const Board& board, ImageSize size, std::span<const LensView> views,
                              int most) {
  std::vector<const BoardSighting*> sightings;
  for (const LensView& view : views) sightings.push_back(&view.sighting);
  return sightings.empty() ? std::vector<int>() : choose_views(board, size, sightings, most);
}

void describe(const LensFitter& fitter, const Fit& fit, LensFit& result) {
  result.lens = fit.lens;
  result.rms_px = fitter.rms_of_fit(fit);
  for (size_t i = 0; i < fit.views.size(); ++i) {
    result.fitted.push_back(
        {fit.views[i], fitter.rms_of_view(fit, i), fit.poses[i], fitter.misses_of(fit, i)});
  }
}

}  // namespace

LensFit fit_lens(const std::string& camera, const Board& board, ImageSize size,
                 std::span<const LensView> views, const LensOptions& options) {
  const std::vector<int> chosen = chosen_views(board, size, views, options.most_views);
  require_views(camera, chosen.size(), views.size());
  LensFit result;
  result.unneeded = static_cast<int>(views.size() - chosen.size());
  const LensFitter fitter(board, size, views);
  Fit fit = fitter.from_scratch(chosen);
  for (int round = 0; round < 4; ++round) {
    fitter.improve(fit, 5);
    if (!reject_outliers(fitter, fit, result.rejected)) break;
    require_views(camera, fit.views.size(), views.size());
  }
  choose_model(fitter, options, fit, result);
  if (reject_outliers(fitter, fit, result.rejected)) {
    require_views(camera, fit.views.size(), views.size());
    fitter.improve(fit, result.coefficients);
  }
  describe(fitter, fit, result);
  return result;
}

}  // namespace v3d::calib
