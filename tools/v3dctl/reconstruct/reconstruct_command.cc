// reconstruct: makes the meshes of a take; and reconstruct-shards, a task of it.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "common/console.h"
#include "take/take.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/reconstruct_options.h"
#include "v3dctl/reconstruct/sharded_reconstruction.h"
#include "v3dctl/reconstruct/take_reconstruction.h"
#include "v3dctl/reconstruct/task_options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kReconstructTask[] = "reconstruct-shards";

double min_of(const std::vector<double>& values) {
  return *std::min_element(values.begin(), values.end());
}

/// Null where no frame has a silhouette.
Json mean_json(const std::vector<double>& values) {
  return values.empty() ? Json(nullptr) : Json(mean(values));
}

/// The sum of counts.
int64_t sum(const std::vector<double>& counts) {
  return static_cast<int64_t>(std::accumulate(counts.begin(), counts.end(), 0.0));
}

Json stages_json(const ReconstructReport& report) {
  Json stages = Json::object();
  for (const StageSamples& stage : report.stages) {
    stages[stage.name] = nullptr;
    if (stage.ms.empty()) continue;
    stages[stage.name] = {{"p50", percentile(stage.ms, 0.50)}, {"p99", percentile(stage.ms, 0.99)}};
  }
  return stages;
}

Json iou_json(const ReconstructReport& report) {
  const std::vector<double>& values = report.silhouette_iou;
  return {{"mean", mean_json(values)},
          {"min", values.empty() ? Json(nullptr) : Json(min_of(values))}};
}

Json silhouettes_json(const ReconstructReport& report) {
  Json cameras = Json::object();
  for (size_t i = 0; i < report.cameras.size(); ++i) {
    cameras[report.cameras[i]] = mean_json(report.camera_iou[i]);
  }
  Json json = iou_json(report);
  json["cameras"] = cameras;
  return json;
}

Json faults_json(const std::vector<PulseFault>& faults) {
  Json list = Json::array();
  for (const PulseFault& fault : faults) {
    const Rect& region = fault.fault.region;
    list.push_back({{"pulse", fault.pulse},
                    {"camera", fault.camera},
                    {"kind", name(fault.fault.kind)},
                    {"region", {region.x0, region.y0, region.width, region.height}},
                    {"pixels", fault.fault.pixels}});
  }
  return list;
}

Json oversized_json(const ReconstructReport& report) {
  Json list = Json::array();
  for (const auto& [pulse, reason] : report.oversized) {
    list.push_back({{"pulse", pulse}, {"reason", reason}});
  }
  return list;
}

Json quality_json(const ReconstructReport& report) {
  Json list = Json::array();
  for (const auto& [pulse, quality] : report.frame_quality) {
    list.push_back({{"pulse", pulse},
                    {"silhouette_iou", quality.silhouette_iou},
                    {"coverage", quality.coverage},
                    {"cameras", quality.cameras}});
  }
  return list;
}

Json proxy_json(const ReconstructReport& proxy) {
  return {{"voxel_m", proxy.voxel_m},
          {"quality", name(proxy.quality)},
          {"volume_m3", median(proxy.volume_m3)},
          {"vertices", median(proxy.vertices)},
          {"triangles", median(proxy.triangles)},
          {"silhouette_iou", iou_json(proxy)},
          {"stages_ms", stages_json(proxy)},
          {"bytes_per_frame", mean(proxy.bytes)}};
}

/// Of the frames that this run made.
double frames_per_second(const ReconstructReport& report) {
  return static_cast<double>(report.frames - report.frames_kept) / report.seconds;
}

Json to_json(const ReconstructReport& report) {
  const Box& box = report.bounds;
  return {
      {"frames", report.frames},
      {"incomplete", report.incomplete},
      {"oversized", oversized_json(report)},
      {"cameras", report.cameras.size()},
      {"camera_names", report.cameras},
      {"voxel_m", report.voxel_m},
      {"bounds_m", {box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()}},
      {"min_views", report.min_views},
      {"threads", report.threads},
      {"processes", report.processes > 0 ? Json(report.processes) : Json(nullptr)},
      {"frames_kept", report.frames_kept},
      {"volume_m3", median(report.volume_m3)},
      {"ghosts", sum(report.ghosts)},
      {"vertices", median(report.vertices)},
      {"triangles", median(report.triangles)},
      {"silhouette_iou", silhouettes_json(report)},
      {"frame_quality", quality_json(report)},
      {"silhouette_faults",
       report.repaired ? faults_json(report.silhouette_faults) : Json(nullptr)},
      {"stages_ms", stages_json(report)},
      {"frames_per_second", frames_per_second(report)},
      {"bytes_per_frame", mean(report.bytes)},
      {"peak_rss_mb", report.peak_rss_mb},
      {"proxy", report.proxy.empty() ? Json(nullptr) : proxy_json(report.proxy.front())}};
}

// A much lower agreement than that of the others suggests a displaced camera.
void print_worst_camera(const ReconstructReport& report) {
  const auto worst = std::min_element(
      report.camera_iou.begin(), report.camera_iou.end(),
      [](const auto& a, const auto& b) { return !a.empty() && (b.empty() || mean(a) < mean(b)); });
  if (worst == report.camera_iou.end() || worst->empty()) return;
  std::printf("             minimum in %s, %.3f (mean)\n",
              report.cameras[static_cast<size_t>(worst - report.camera_iou.begin())].c_str(),
              mean(*worst));
}

void print_mesh(const char* what, const ReconstructReport& report) {
  std::printf("%-12s %s vertices, %s triangles, %s a frame\n", what,
              format_count(static_cast<int64_t>(median(report.vertices))).c_str(),
              format_count(static_cast<int64_t>(median(report.triangles))).c_str(),
              format_bytes(mean(report.bytes)).c_str());
}

void print_silhouettes(const ReconstructReport& report) {
  if (report.silhouette_iou.empty()) {
    std::printf("silhouettes  no frame shows one\n");
    return;
  }
  std::printf("silhouettes  IoU %.3f (mean), %.3f (minimum)\n", mean(report.silhouette_iou),
              min_of(report.silhouette_iou));
}

void print_stages(const ReconstructReport& report) {
  for (const StageSamples& stage : report.stages) {
    if (stage.ms.empty()) continue;
    std::printf("%-12s %.1f ms (median), %.1f ms (99th percentile)\n", stage.name.c_str(),
                percentile(stage.ms, 0.50), percentile(stage.ms, 0.99));
  }
}

void print_proxy(const ReconstructReport& proxy) {
  std::printf("\nproxy, voxel %s, %s quality; segmentation is shared\n",
              format_length(proxy.voxel_m).c_str(), std::string(name(proxy.quality)).c_str());
  print_mesh("mesh", proxy);
  print_silhouettes(proxy);
  print_stages(proxy);
}

void print_text(const ReconstructReport& report) {
  std::printf("%s, %s, voxel %s, min. %d views\n", count_of(report.frames, "frame").c_str(),
              count_of(std::ssize(report.cameras), "camera").c_str(),
              format_length(report.voxel_m).c_str(), report.min_views);
  std::printf("volume       %.4g m3 (median)\n", median(report.volume_m3));
  if (const int64_t ghosts = sum(report.ghosts); ghosts > 0)
    std::printf("ghosts       %s removed\n", format_count(ghosts).c_str());
  print_mesh("mesh", report);
  print_silhouettes(report);
  print_worst_camera(report);
  for (const std::string& line : fault_lines(report.silhouette_faults)) {
    std::printf("repaired     %s\n", line.c_str());
  }
  print_stages(report);
  for (const ReconstructReport& proxy : report.proxy) print_proxy(proxy);
  std::printf("whole run    %.1f s, %.2f frames/s on %d threads, %.0f MB memory\n", report.seconds,
              frames_per_second(report), report.threads, report.peak_rss_mb);
}

ReconstructReport reconstruct(const ReconstructArguments& arguments) {
  // At live quality: few shards use a whole cluster, many reduce the share of a task's start-up.
  constexpr int64_t kMinShardsPerTask = 4;
  const ReconstructRequest& request = arguments.request;
  const std::optional<TaskPlaces> places = task_places(arguments.tasks, request.threads);
  if (!places) return reconstruct_take(request);
  ReconstructReport report = reconstruct_sharded(
      request, places->all_threads(),
      [&](const ShardFolder& folder, const ReconstructRequest& complete) {
        const int64_t min_shards = complete.quality == Quality::kHigh ? 1 : kMinShardsPerTask;
        return make_task_runner(*places, folder, kReconstructTask, min_shards);
      });
  report.processes = places->processes;
  return report;
}

/// Reports on stderr what is not whole. Returns the exit status.
int report_gaps(const ReconstructReport& report, const std::filesystem::path& take) {
  for (const std::string& error : report.read_errors) note("v3dctl: " + error);
  if (!report.oversized.empty()) {
    note("v3dctl: " + count_of(std::ssize(report.oversized), "pulse") + " without a mesh; " +
         report.oversized.front().second);
  }
  const int status = report_incomplete_frames(report.incomplete, take);
  return report.read_errors.empty() && report.oversized.empty() ? status : kExitIncomplete;
}

/// Reports the pulses that --passes live made with another number of passes than live, because
/// mesh.v3d stated none: v3d-recond drops meshes that are late.
void report_default_passes(const ReconstructReport& report, const ReconstructRequest& request) {
  const std::vector<int64_t> pulses = pulses_with_default_passes(request, report);
  if (pulses.empty()) return;
  note("--passes live: no intact mesh in mesh.v3d of " + count_of(std::ssize(pulses), "pulse") +
       ", from " + std::to_string(pulses.front()) + " to " + std::to_string(pulses.back()) + ": " +
       std::to_string(request.live_passes.value_or(recon::kDefaultLivePasses)) + " passes there");
}

int run(const CommandLine& line, ReconstructArguments arguments) {
  arguments.request = request_of(line, arguments);
  catch_interrupts();
  const ReconstructReport report = reconstruct(arguments);
  if (arguments.json) {
    std::printf("%s\n", to_json(report).dump(2).c_str());
  } else {
    print_text(report);
  }
  report_default_passes(report, arguments.request);
  return report_gaps(report, arguments.request.take);
}

}  // namespace

void add_reconstruct(CommandLine& line) {
  cli::Command command =
      line.add("reconstruct", "Make the meshes of a take (mesh.v3d)",
               {"v3dctl reconstruct dancer --voxel 8mm --bounds -0.6,-0.6,-0.1,0.6,0.6,1.9",
                "v3dctl reconstruct dancer --frames 100:200 --leave-out cam03,cam11 --json",
                "v3dctl reconstruct kendo-07 --voxel 5mm --proxy 10mm",
                "v3dctl reconstruct kendo-07 --quality high --slurm --partition night"});
  auto arguments = std::make_shared<ReconstructArguments>();
  add_reconstruct_options(command, *arguments);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
  add_task_command(line, kReconstructTask, "A task of v3dctl reconstruct",
                   [](const std::string& folder, take::FrameRange shards, int threads) {
                     reconstruct_shards(ShardFolder(folder), shards, threads);
                   });
}

}  // namespace v3d::ctl
