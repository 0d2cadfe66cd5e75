#include "calib/lens/rig_lenses.h"

#include <algorithm>

#include "base/error.h"
#include "base/image_size.h"
#include "base/statistics.h"
#include "calib/boards/board_pose.h"
#include "calib/lens/lens_fit.h"
#include "calib/parallel_for.h"

namespace v3d::calib {
namespace {

constexpr double kSuspiciousPx = 1.0;

LensFit fit_own_lens(const Board& board, const CameraSightings& camera) {
  std::vector<LensView> views;
  for (const auto& [instant, sighting] : camera.sightings) {
    views.push_back({std::to_string(instant), sighting});
  }
  return fit_lens(camera.name, board, camera.size, views, {});
}

CameraModel lens_before(const Rig& before, const CameraSightings& camera) {
  const int index = find_camera(before, camera.name);
  if (index < 0) throw InputError("the calibration before has no camera " + camera.name);
  const CameraModel& lens = before[static_cast<size_t>(index)].model;
  if (!(lens.size() == camera.size)) {
    throw InputError(camera.name + ": its pictures are " + format_size(camera.size) +
                     ", its lens was calibrated at " + format_size(lens.size()));
  }
  return placed(lens, {});
}

/// How well some of the camera's boards can be explained through a lens, pixels.
double misfit(const CameraModel& lens, const Board& board, const CameraSightings& camera) {
  std::vector<double> rms;
  const size_t step = 1 + camera.sightings.size() / 20;
  size_t at = 0;
  for (const auto& [instant, sighting] : camera.sightings) {
    if (at++ % step != 0) continue;
    const auto poses = board_poses(lens, board, sighting);
    if (!poses.empty()) rms.push_back(poses.front().rms_px);
  }
  return rms.empty() ? 1e9 : upper_median(rms);
}

void refuse_exchanged_lenses(const Board& board, const std::vector<CameraSightings>& cameras,
                             const std::vector<CameraModel>& lenses) {
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      if (!(cameras[a].size == cameras[b].size)) continue;
      const double own_a = misfit(lenses[a], board, cameras[a]);
      const double own_b = misfit(lenses[b], board, cameras[b]);
      const double other_a = misfit(lenses[b], board, cameras[a]);
      const double other_b = misfit(lenses[a], board, cameras[b]);
      if (2 * other_a < own_a && 2 * other_b < own_b && std::min(own_a, own_b) > kSuspiciousPx) {
        refuse_swapped(cameras[a].name, cameras[b].name, "the pictures of each fit the lens of");
      }
    }
  }
}

}  // namespace

RigLenses find_rig_lenses(const Board& board, const std::vector<CameraSightings>& cameras,
                          const std::optional<Rig>& before, int threads) {
  RigLenses found{std::vector<CameraModel>(cameras.size()), std::vector<int>(cameras.size(), 0)};
  if (before) {
    for (size_t i = 0; i < cameras.size(); ++i) found.lenses[i] = lens_before(*before, cameras[i]);
    refuse_exchanged_lenses(board, cameras, found.lenses);
    return found;
  }
  on_threads(threads, static_cast<int>(cameras.size()), [&](int i) {
    const LensFit fit = fit_own_lens(board, cameras[i]);
    found.lenses[i] = fit.lens;
    found.coefficients[i] = fit.coefficients;
  });
  return found;
}

void refuse_swapped(const std::string& a, const std::string& b, const std::string& why) {
  throw InputError("swapped cameras: " + a + " and " + b + ": " + why +
                   " the other: exchange their cables, addresses or files");
}

}  // namespace v3d::calib
