#include "v3dctl/reconstruct/reconstruct_request.h"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "common/console.h"
#include "take/take_lock.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

Box reported_default_bounds(const Rig& rig, int min_views) {
  const Box box = default_bounds(rig, min_views);
  note(
      fmt::format("bounds seen by at least half the cameras: --bounds "
                  "{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f}",
                  box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()));
  return box;
}

Json deform_to_json(const recon::DeformOptions& deform) {
  return {{"mode", static_cast<int>(deform.mode)},
          {"internal", deform.internal},
          {"photometric", deform.photometric},
          {"silhouette", deform.silhouette},
          {"window", deform.window},
          {"views", deform.views},
          {"hollows", deform.carve_concavities}};
}

recon::DeformOptions deform_from_json(const Json& json) {
  recon::DeformOptions deform;
  deform.mode = static_cast<recon::DeformMode>(json.at("mode").get<int>());
  deform.internal = json.at("internal");
  deform.photometric = json.at("photometric");
  deform.silhouette = json.at("silhouette");
  deform.window = json.at("window");
  deform.views = json.at("views");
  deform.carve_concavities = json.at("hollows");
  return deform;
}

/// Lowest quality first.
constexpr std::array<std::pair<std::string_view, Quality>, 3> kQualities{
    {{"live", Quality::kLive}, {"medium", Quality::kMedium}, {"high", Quality::kHigh}}};

auto entry_of(Quality quality) {
  return std::ranges::find(kQualities, quality, &std::pair<std::string_view, Quality>::second);
}

/// Sets the quality of a requested proxy, and checks it against the mesh.
void complete_proxy(ReconstructRequest& request) {
  if (!request.proxy_voxel_m) return;
  if (*request.proxy_voxel_m <= *request.voxel_m) {
    throw InputError("--proxy " + format_length(*request.proxy_voxel_m) + ": expected more than " +
                     format_length(*request.voxel_m) + ", the voxels of the mesh (--voxel)");
  }
  if (!request.proxy_quality) request.proxy_quality = request.quality;
  if (entry_of(*request.proxy_quality) > entry_of(*request.quality)) {
    throw InputError("--proxy-quality " + std::string(name(*request.proxy_quality)) +
                     ": expected at most " + std::string(name(*request.quality)) +
                     ", the quality of the mesh (--quality)");
  }
}

/// Throws InputError when `option`, which has an effect with `needed` alone, would be ignored.
void require_quality(const ReconstructRequest& complete, const std::string& option,
                     Quality needed) {
  if (complete.quality == needed || complete.proxy_quality == needed) return;
  const std::string expected(name(needed));
  throw InputError(option + ": only " + expected + " quality uses it, but the quality is " +
                   std::string(name(*complete.quality)) + "; expected --quality " + expected);
}

void check_quality_options(const ReconstructRequest& complete) {
  if (complete.live_passes || !complete.pulse_passes.empty()) {
    require_quality(complete, "--passes", Quality::kMedium);
  }
  if (complete.deform) require_quality(complete, "--deform", Quality::kHigh);
}

}  // namespace

std::string_view name(Quality quality) { return entry_of(quality)->first; }

Quality parse_quality(std::string_view text, std::string_view option) {
  for (const auto& [name, quality] : kQualities) {
    if (text == name) return quality;
  }
  throw InputError(std::string(option) + " " + std::string(text) +
                   ": expected live, medium or high");
}

take::TakeInfo info_of_ended_take(const take::TakePaths& take) {
  take::TakeInfo info = take::load_take_info(take);
  const std::string holder = io::value_or_throw(take::take_lock_holder(take));
  if (!holder.empty()) {
    throw InputError(take.folder.string() + ": is being recorded or recovered by " + holder +
                     "; repeat this command when the take has ended");
  }
  return info;
}

recorded::TakeFrames open_take(const ReconstructRequest& request) {
  const take::TakeInfo info = info_of_ended_take({request.take});
  return {request.take, cameras_without(info, request.leave_out)};
}

std::vector<std::string> cameras_without(const take::TakeInfo& info,
                                         const std::vector<std::string>& leave_out) {
  for (const std::string& name : leave_out) {
    if (std::ranges::find(info.cameras, name) == info.cameras.end()) {
      throw InputError("--leave-out " + name + ": the take has no such camera; expected some of " +
                       join_names(info.cameras));
    }
  }
  std::vector<std::string> cameras;
  for (const std::string& name : info.cameras) {
    if (std::ranges::find(leave_out, name) == leave_out.end()) cameras.push_back(name);
  }
  if (cameras.empty())
    throw InputError("--leave-out: leaves no camera of the take; expected at least one to remain");
  return cameras;
}

ReconstructRequest with_defaults(const ReconstructRequest& request,
                                 const recorded::TakeFrames& take) {
  const Studio* studio =
      request.studio && request.studio->name == take.info().studio ? &*request.studio : nullptr;
  const int cameras = static_cast<int>(take.rig().size());
  ReconstructRequest complete = request;
  complete.studio.reset();
  complete.voxel_m = request.voxel_m.value_or(studio ? studio->reconstruction.voxel_m : 0.01);
  complete.quality =
      request.quality.value_or(studio ? studio->reconstruction.quality : Quality::kLive);
  complete.min_views = request.min_views.value_or(
      std::min(cameras, studio ? studio->reconstruction.min_views : default_min_views(cameras)));
  if (complete.min_views > cameras) {
    throw InputError("--min-views " + std::to_string(*complete.min_views) + ": expected at most " +
                     std::to_string(cameras) + " cameras, the number that takes part");
  }
  complete_proxy(complete);
  check_quality_options(complete);
  if (!request.bounds) {
    complete.bounds =
        studio ? studio->space.bounds : reported_default_bounds(take.rig(), *complete.min_views);
  }
  return complete;
}

ReconstructRequest proxy_request(const ReconstructRequest& complete) {
  ReconstructRequest proxy = complete;
  proxy.voxel_m = complete.proxy_voxel_m;
  proxy.quality = complete.proxy_quality;
  proxy.proxy_voxel_m.reset();
  proxy.proxy_quality.reset();
  return proxy;
}

std::optional<std::filesystem::path> proxy_path(const ReconstructRequest& complete,
                                                const take::TakePaths& take) {
  return complete.proxy_voxel_m ? std::optional(take.proxy()) : std::nullopt;
}

recon::ReconstructOptions options_of(const ReconstructRequest& complete, int threads) {
  recon::ReconstructOptions options;
  options.bounds = *complete.bounds;
  options.voxel_m = *complete.voxel_m;
  options.min_views = *complete.min_views;
  options.quality = *complete.quality;
  options.live_passes = complete.live_passes.value_or(recon::kDefaultLivePasses);
  options.deform = complete.deform.value_or(recon::DeformOptions());
  options.threads = threads;
  return options;
}

Json request_to_json(const ReconstructRequest& complete) {
  const Box& box = *complete.bounds;
  return {
      {"bounds_m", {box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()}},
      {"voxel_m", *complete.voxel_m},
      {"min_views", *complete.min_views},
      {"quality", static_cast<int>(*complete.quality)},
      {"proxy_voxel_m", complete.proxy_voxel_m ? Json(*complete.proxy_voxel_m) : Json(nullptr)},
      {"proxy_quality",
       complete.proxy_quality ? Json(static_cast<int>(*complete.proxy_quality)) : Json(nullptr)},
      {"live_passes", complete.live_passes.value_or(recon::kDefaultLivePasses)},
      {"pulse_passes", complete.pulse_passes},
      {"deform", deform_to_json(complete.deform.value_or(recon::DeformOptions()))},
      {"smooth", complete.smooth},
      {"repair", complete.repair},
      {"repair_pulses", complete.repair_pulses ? Json(*complete.repair_pulses) : Json(nullptr)},
      {"frames", {complete.frames.begin, complete.frames.end}},
      {"leave_out", complete.leave_out}};
}

ReconstructRequest request_from_json(const Json& json) {
  ReconstructRequest request;
  const auto box = json.at("bounds_m").get<std::array<double, 6>>();
  request.bounds = Box{{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
  request.voxel_m = json.at("voxel_m").get<double>();
  request.min_views = json.at("min_views").get<int>();
  request.quality = static_cast<Quality>(json.at("quality").get<int>());
  if (const Json& voxel = json.at("proxy_voxel_m"); !voxel.is_null()) {
    request.proxy_voxel_m = voxel.get<double>();
    request.proxy_quality = static_cast<Quality>(json.at("proxy_quality").get<int>());
  }
  request.live_passes = json.at("live_passes").get<int>();
  request.pulse_passes = json.at("pulse_passes").get<std::map<int64_t, int>>();
  request.deform = deform_from_json(json.at("deform"));
  request.smooth = json.at("smooth");
  request.repair = json.at("repair");
  if (const Json& pulses = json.at("repair_pulses"); !pulses.is_null()) {
    request.repair_pulses = pulses.get<std::vector<int64_t>>();
  }
  request.frames.begin = json.at("frames").at(0);
  request.frames.end = json.at("frames").at(1);
  request.leave_out = json.at("leave_out").get<std::vector<std::string>>();
  return request;
}

std::vector<int64_t> pulses_of(const ReconstructRequest& request,
                               const recorded::TakeFrames& take) {
  const std::vector<int64_t> all = take.pulses();
  if (all.empty()) throw InputError(take.paths().folder.string() + ": the take has no frames");
  std::vector<int64_t> pulses;
  std::copy_if(all.begin(), all.end(), std::back_inserter(pulses),
               [&](int64_t pulse) { return request.frames.contains(pulse); });
  if (pulses.empty()) {
    throw InputError("--frames: the take has none of these frames; expected some of " +
                     std::to_string(all.front()) + " to " + std::to_string(all.back()));
  }
  return pulses;
}

int64_t pulses_without_frames(const ReconstructRequest& request, const recorded::TakeFrames& take) {
  const int64_t end = std::min(take.info().pulses, request.frames.end);
  const auto with_frames = std::ssize(pulses_of(request, take));
  return std::max<int64_t>(0, end - request.frames.begin - with_frames);
}

int threads_of(const ReconstructRequest& request) {
  if (request.threads > 0) return request.threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

namespace {

constexpr int kSamples = 64;  // along each axis

bool is_in_front(const RigCamera& camera, const Eigen::Vector3d& point) {
  return (point - camera.model.center()).dot(camera.model.viewing_direction()) > 0;
}

// Least squares: solves sum over cameras of (I - d d^T)(p - c) = 0, with a small weight of the
// cameras' mean position. Throws InputError where the axes are almost parallel, or most cameras
// look away from that point: these see a space without an end.
Eigen::Vector3d point_nearest_to_axes(const Rig& rig) {
  constexpr double kMinSquaredSine = 2e-4;  // two axes at 1.6 degrees
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const RigCamera& camera : rig) {
    const Eigen::Vector3d d = camera.model.viewing_direction();
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - d * d.transpose() + 1e-6 * Eigen::Matrix3d::Identity();
    a += across;
    b += across * camera.model.center();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(a);
  const auto cameras = static_cast<double>(rig.size());
  if (axes.eigenvalues().minCoeff() > kMinSquaredSine * cameras) {
    const Eigen::Vector3d point = a.ldlt().solve(b);
    const auto in_front = std::ranges::count_if(
        rig, [&](const RigCamera& camera) { return is_in_front(camera, point); });
    if (2 * in_front > std::ssize(rig)) return point;
  }
  throw InputError(std::string(rig.size() == 1 ? "one camera limits no space"
                                               : "the views of the cameras do not converge, so "
                                                 "they limit no space") +
                   "; expected --bounds, or a studio file with [space]");
}

int cameras_seeing(const Rig& rig, const Eigen::Vector3d& point) {
  return static_cast<int>(std::count_if(rig.begin(), rig.end(), [&](const RigCamera& camera) {
    const auto pixel = camera.model.project(point);
    return pixel && camera.model.inside_image(*pixel);
  }));
}

double median_distance(const Rig& rig, const Eigen::Vector3d& point) {
  std::vector<double> distances;
  for (const RigCamera& camera : rig) distances.push_back((camera.model.center() - point).norm());
  return median(distances);
}

}  // namespace

int default_min_views(int cameras) { return std::clamp(cameras - 1, 1, 4); }

Box observed_bounds(const Rig& rig, int min_cameras) {
  const Eigen::Vector3d focus = point_nearest_to_axes(rig);
  const double radius = median_distance(rig, focus);
  const double step = 2 * radius / kSamples;
  Box seen{Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()),
           Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity())};
  for (int k = 0; k < kSamples; ++k) {
    for (int j = 0; j < kSamples; ++j) {
      for (int i = 0; i < kSamples; ++i) {
        const Eigen::Vector3d offset =
            step * (Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5 - 0.5 * kSamples));
        if (offset.norm() > radius || cameras_seeing(rig, focus + offset) < min_cameras) continue;
        seen.min = seen.min.cwiseMin(focus + offset - Eigen::Vector3d::Constant(0.5 * step));
        seen.max = seen.max.cwiseMax(focus + offset + Eigen::Vector3d::Constant(0.5 * step));
      }
    }
  }
  if (!(seen.min.array() < seen.max.array()).all()) {
    throw InputError("no point is seen by " + std::to_string(min_cameras) +
                     " cameras; expected --bounds, or a smaller --min-views");
  }
  return seen;
}

Box default_bounds(const Rig& rig, int min_views) {
  const int cameras = static_cast<int>(rig.size());
  return observed_bounds(rig, std::max(min_views, (cameras + 1) / 2));
}

}  // namespace v3d::ctl
