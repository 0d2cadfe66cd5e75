#include "v3dctl/reconstruct/reconstruct_request.h"

#include <algorithm>
#include <cstdio>
#include <thread>

#include "base/error.h"
#include "common/console.h"
#include "v3dctl/reconstruct/left_out.h"
#include "v3dctl/reconstruct/reconstruction_bounds.h"

namespace v3d::ctl {
namespace {

Box found_bounds(const Rig& rig, int min_views) {
  const int cameras = static_cast<int>(rig.size());
  const Box box = common_view(rig, std::max(min_views, (cameras + 1) / 2));
  char text[160];
  std::snprintf(
      text, sizeof text,
      "bounds: where at least half the cameras look: --bounds %.3f,%.3f,%.3f,%.3f,%.3f,%.3f",
      box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z());
  note(text);
  return box;
}

}  // namespace

TakeFrames open_take(const ReconstructRequest& request) {
  return {request.take, cameras_without(load_take_info({request.take}), request.leave_out)};
}

ReconstructRequest settle(const ReconstructRequest& request, const TakeFrames& take) {
  const Studio* studio =
      request.studio && request.studio->name == take.info().studio ? &*request.studio : nullptr;
  const int cameras = static_cast<int>(take.rig().size());
  ReconstructRequest settled = request;
  settled.studio.reset();
  settled.voxel_m = request.voxel_m.value_or(studio ? studio->reconstruction.voxel_m : 0.01);
  settled.quality =
      request.quality.value_or(studio ? studio->reconstruction.quality : Quality::kLive);
  settled.min_views = request.min_views.value_or(
      std::min(cameras, studio ? studio->reconstruction.min_views : default_min_views(cameras)));
  if (settled.min_views > cameras) {
    throw InputError("--min-views " + std::to_string(*settled.min_views) + ": only " +
                     std::to_string(cameras) + " cameras take part");
  }
  if (!request.bounds) {
    settled.bounds = studio ? studio->space.bounds : found_bounds(take.rig(), *settled.min_views);
  }
  return settled;
}

ReconstructOptions options_of(const ReconstructRequest& settled, int threads) {
  ReconstructOptions options;
  options.bounds = *settled.bounds;
  options.voxel_m = *settled.voxel_m;
  options.min_views = *settled.min_views;
  options.quality = *settled.quality;
  options.deform = settled.deform;
  options.threads = threads;
  return options;
}

std::vector<int64_t> pulses_of(const ReconstructRequest& request, const TakeFrames& take) {
  const std::vector<int64_t> all = take.pulses();
  if (all.empty()) throw InputError(take.paths().folder.string() + ": the take holds no frames");
  std::vector<int64_t> pulses;
  std::copy_if(all.begin(), all.end(), std::back_inserter(pulses),
               [&](int64_t pulse) { return request.frames.contains(pulse); });
  if (pulses.empty()) {
    throw InputError("--frames: the take has none of them; it has " + std::to_string(all.front()) +
                     " to " + std::to_string(all.back()));
  }
  return pulses;
}

int64_t pulses_without_frames(const ReconstructRequest& request, const TakeFrames& take) {
  const int64_t end = std::min(take.info().pulses, request.frames.end);
  const auto with_frames = std::ssize(pulses_of(request, take));
  return std::max<int64_t>(0, end - request.frames.begin - with_frames);
}

int default_min_views(int cameras) { return std::clamp(cameras - 1, 1, 4); }

int threads_of(const ReconstructRequest& request) {
  if (request.threads > 0) return request.threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace v3d::ctl
