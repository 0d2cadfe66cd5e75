// track: follows the surface of a take through its pulses.
#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/recorded_file.h"
#include "codec/motion_header.h"
#include "common/console.h"
#include "take/take.h"
#include "v3dctl/command_line.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/motion/sharded_tracking.h"
#include "v3dctl/motion/take_motion.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/task_options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::filesystem::path take, meshes, out, truth;
  std::string frames, without, height, step = "0.5mm";
  int64_t triangles = 30'000;
  int threads = 0;
  TaskArguments tasks;
  bool json = false;
};

constexpr char kTrackTask[] = "track-shards";

recon::TrackingOptions tracking_of(const Arguments& arguments) {
  recon::TrackingOptions options;
  options.triangles = static_cast<size_t>(arguments.triangles);
  for (const std::string& part : parse_names(arguments.without, "--without")) {
    if (part == "photometry") {
      options.photometry = false;
    } else if (part == "heterogeneity") {
      options.heterogeneity = false;
    } else if (part == "fusion") {
      options.fusion = false;
    } else {
      throw InputError("--without " + part +
                       ": expected photometry, heterogeneity or fusion, separated by commas");
    }
  }
  return options;
}

/// Is the result of --meshes motion.v3d in the folder OUT?
bool has_output_folder(const Arguments& arguments) {
  return !arguments.meshes.empty() && arguments.out.empty() && arguments.take.extension() != ".v3d";
}

/// The file for the surface that is tracked through a folder of meshes.
std::filesystem::path output_of(const Arguments& arguments) {
  if (arguments.take.empty() == arguments.out.empty()) {
    throw InputError("--meshes needs one place for the result: OUT or --out FILE");
  }
  if (!arguments.out.empty()) return arguments.out;
  return has_output_folder(arguments) ? take::TakePaths{arguments.take}.motion() : arguments.take;
}

double step_of(const std::string& text) {
  const double step = parse_length(text);
  if (step >= codec::MotionLimits::kMinStep && step <= codec::MotionLimits::kMaxStep) return step;
  throw InputError("--step " + text + ": expected a length from 1e-9 m to 1 m");
}

/// Creates the folder OUT, but not for meshes that would be rejected before the tracking.
void create_output_folder(const Arguments& arguments, const TrackRequest& request) {
  require_steps(request, *open_input(request));
  io::throw_if_failed(io::create_folders(arguments.take));
}

/// Before the tracking, which can take hours. Throws InputError where the result could not be
/// written, or not be compared, after it.
void check_places(const Arguments& arguments, const TrackRequest& request) {
  if (!arguments.truth.empty() && !std::filesystem::is_directory(arguments.truth)) {
    throw InputError("--truth " + arguments.truth.string() +
                     ": is not a folder; expected one of v3d-sim take --truth");
  }
  if (request.out.empty()) return;
  require_unrecorded(request.out);
  if (has_output_folder(arguments)) create_output_folder(arguments, request);
  check_output({arguments.out.empty() ? "OUT" : "--out", request.out});
}

TrackRequest request_of(const Arguments& arguments) {
  TrackRequest request;
  request.meshes_only = !arguments.meshes.empty();
  if (request.meshes_only) {
    if (!arguments.truth.empty()) throw InputError("--truth needs a take, not --meshes");
    request.input = arguments.meshes;
    request.out = output_of(arguments);
  } else {
    if (arguments.take.empty()) {
      throw InputError("expected the folder of a take, or OUT --meshes DIR");
    }
    request.input = arguments.take;
    request.out = arguments.out;
  }
  if (!arguments.height.empty() && !request.meshes_only) {
    throw InputError("--height scales the meshes of --meshes; those of a take are in metres");
  }
  if (!arguments.height.empty()) request.height_m = parse_length(arguments.height);
  request.frames = parse_frame_range(arguments.frames);
  request.tracking = tracking_of(arguments);
  request.step_m = step_of(arguments.step);
  request.threads = arguments.threads;
  return request;
}

/// The tracked surface against the truth.
struct Comparison {
  TruthReport surface;
  std::optional<MotionReport> motion;  ///< empty without true points
};

Comparison compare_with_truth(const Arguments& arguments) {
  const std::filesystem::path file =
      arguments.out.empty() ? take::TakePaths{arguments.take}.motion() : arguments.out;
  const EvaluatedMeshes tracked{arguments.take, file};
  return {evaluate_truth(tracked, arguments.truth), evaluate_motion(tracked, arguments.truth)};
}

/// The report after `pulses`; the last one of a shorter take.
const CarriedReport& carried_over(const MotionReport& motion, int64_t pulses) {
  const auto found = std::ranges::find(motion.carried, pulses, &CarriedReport::pulses);
  return found == motion.carried.end() ? motion.carried.back() : *found;
}

Json residuals_json(const std::vector<std::pair<int64_t, recon::PulseResidual>>& residuals) {
  constexpr double kMillimetres = 1000;
  Json list = Json::array();
  for (const auto& [pulse, residual] : residuals) {
    list.push_back({{"pulse", pulse},
                    {"p50_mm", kMillimetres * residual.median_m},
                    {"p90_mm", kMillimetres * residual.p90_m},
                    {"far", residual.far},
                    {"surplus", residual.surplus},
                    {"silhouette_iou", residual.silhouette_iou},
                    {"matched_patches", residual.matched_patches},
                    {"patch_correlation", residual.correlation}});
  }
  return list;
}

Json report_json(const TrackReport& report) {
  Json tracked = Json::array();
  std::vector<double> triangles;
  for (const TrackedSegmentReport& segment : report.segments) {
    triangles.push_back(static_cast<double>(segment.triangles));
    tracked.push_back({{"first_pulse", segment.first},
                       {"last_pulse", segment.last},
                       {"key_pulse", segment.key},
                       {"pulses", segment.pulses},
                       {"vertices", segment.vertices},
                       {"triangles", segment.triangles},
                       {"residual_p50_mm", segment.residual_p50_mm},
                       {"residual_p90_mm", segment.residual_p90_mm},
                       {"max_far", segment.far},
                       {"matched_patches", segment.matched_patches},
                       {"patch_correlation", segment.patch_correlation},
                       {"residuals", residuals_json(segment.residuals)}});
  }
  Json untracked = Json::array();
  for (const UntrackedReport& gap : report.untracked) {
    untracked.push_back(
        {{"first_pulse", gap.first}, {"last_pulse", gap.last}, {"reason", gap.reason}});
  }
  const auto pulses = static_cast<double>(report.pulses);
  return {{"segments", report.segments.size()},
          {"pulses", report.pulses},
          {"triangles", median(triangles)},
          {"bytes_per_frame", static_cast<double>(report.bytes) / pulses},
          {"seconds_per_pulse", report.seconds / pulses},
          {"tracked", tracked},
          {"untracked", untracked},
          {"bytes", report.bytes},
          {"template_bytes", report.template_bytes},
          {"position_bytes", report.position_bytes},
          {"colour_bytes", report.colour_bytes},
          {"confidence_bytes", report.confidence_bytes},
          {"seconds", report.seconds},
          {"peak_rss_mb", report.peak_rss_mb}};
}

void put_comparison(Json& json, const Comparison& truth) {
  put_truth(json, truth.surface);
  json["epe_mm"] = nullptr;
  json["drift_mm"] = nullptr;
  if (!truth.motion) return;
  const CarriedReport& after_50 = carried_over(*truth.motion, 50);
  const CarriedReport& after_100 = carried_over(*truth.motion, 100);
  json["epe_mm"] = {{"p50", after_50.all.p50_mm},
                    {"p90", after_50.all.p90_mm},
                    {"after_pulses", after_50.pulses}};
  if (after_100.sleeves.points > 0) json["drift_mm"] = after_100.sleeves.tangential_p50_mm;
  json["drift_after_pulses"] = after_100.pulses;
  json["motion"] = to_json(*truth.motion);
}

void print_comparison(const Comparison& truth) {
  const recon::SurfaceDistance& distance = truth.surface.distance;
  fmt::print(
      "surface      {:.2f} mm (median), {:.1f} mm (90 %) from the truth, f-score {:.3f} at 5 mm\n",
      distance.accuracy_p50_mm, distance.accuracy_p90_mm, distance.f_score_5mm);
  if (!truth.motion) return;
  const CarriedReport& after = carried_over(*truth.motion, 50);
  fmt::print("points       {:.1f} mm (median), {:.1f} mm (90 %) from their true places after {}\n",
             after.all.p50_mm, after.all.p90_mm, count_of(after.pulses, "pulse"));
}

std::string pulses_text(int64_t first, int64_t last) {
  return first == last ? "pulse " + format_count(first)
                       : "pulses " + format_count(first) + " to " + format_count(last);
}

void print_text(const TrackReport& report) {
  fmt::print("{} in {}, {:.1f} s\n", count_of(report.pulses, "pulse"),
             count_of(std::ssize(report.segments), "segment"), report.seconds);
  for (const TrackedSegmentReport& segment : report.segments) {
    fmt::print("segment      {}, template of pulse {}, {} triangles, residual {:.1f} mm (median)\n",
               pulses_text(segment.first, segment.last), format_count(segment.key),
               format_count(segment.triangles), segment.residual_p50_mm);
  }
  for (const UntrackedReport& gap : report.untracked) {
    fmt::print("not tracked  {}: {}\n", pulses_text(gap.first, gap.last), gap.reason);
  }
  const int64_t tracked = std::max<int64_t>(1, report.pulses);
  fmt::print("file         {} bytes, {} for each pulse\n", format_count(report.bytes),
             format_count(report.bytes / tracked));
}

/// The file of the result.
std::string result_of(const TrackRequest& request) {
  return (request.out.empty() ? take::TakePaths{request.input}.motion() : request.out).string();
}

/// Reports the end of a file that is full, and a file that is too long for the viewer.
void report_length(const TrackReport& report, const TrackRequest& request) {
  // MAX_BYTES of tools/viewer/player/src/motion_file.ts
  constexpr int64_t kViewerBytes = int64_t{512} << 20;
  if (report.full_from) {
    const std::string first = std::to_string(*report.full_from);
    note("v3dctl: " + result_of(request) + ": ends before pulse " + first +
         ", because programs read at most " + format_bytes(static_cast<double>(request.max_bytes)) +
         " and " + format_count(codec::MotionLimits::kSegments) +
         " segments; track the rest with --frames " + first + ": --out FILE");
  } else if (report.bytes > kViewerBytes) {
    note("v3dctl: " + result_of(request) + ": is too long for the viewer, which plays at most " +
         format_bytes(static_cast<double>(kViewerBytes)) + "; other programs read it");
  }
}

/// Reports what is not whole on stderr. Returns the exit status.
int report_gaps(const TrackReport& report, const TrackRequest& request) {
  const std::filesystem::path& input = request.input;
  report_length(report, request);
  for (const std::string& error : report.read_errors) note("v3dctl: " + error);
  if (!report.without_images.empty()) {
    note("v3dctl: " + input.string() + ": " +
         count_of(std::ssize(report.without_images), "tracked pulse") + " without images, from " +
         std::to_string(report.without_images.front()) + " to " +
         std::to_string(report.without_images.back()) +
         ": the colours are those of the nearest pulse with images");
  }
  const bool whole = report.read_errors.empty() && !report.full_from;
  const int status = whole ? kExitDone : kExitIncomplete;
  return report.is_unfinished ? report_missing_index(take::TakePaths{input}.mesh()) : status;
}

/// Tracks in this process or by tasks, and shows the progress. `places`: of the tasks.
TrackReport track(const TrackRequest& request, const std::optional<TaskPlaces>& places) {
  std::optional<Progress> progress;
  int64_t turns = 0;
  // The surface of a pulse is read for the choice of key pulses, and the pulse in each of two
  // passes; once more where a segment ends, and where it may be a key pulse.
  const auto on_begin = [&](int64_t pulses) { progress.emplace("track", turns = 3 * pulses); };
  const auto on_pulse = [&] {
    if (turns-- > 0) progress->advance();
  };
  if (!places) return track_take(request, on_begin, on_pulse);
  const auto make_runner = [&](const TaskFolder& folder) {
    return make_task_runner(*places, folder, kTrackTask, 1);
  };
  return track_sharded(request, make_runner, on_begin, on_pulse);
}

int run(const Arguments& arguments) {
  const TrackRequest request = request_of(arguments);
  const std::optional<TaskPlaces> places = task_places(arguments.tasks, request.threads);
  check_places(arguments, request);
  catch_interrupts();
  const TrackReport report = track(request, places);
  std::optional<Comparison> truth;
  if (!arguments.truth.empty()) truth = compare_with_truth(arguments);
  if (arguments.json) {
    Json json = report_json(report);
    if (truth) put_comparison(json, *truth);
    fmt::print("{}\n", json.dump(2));
  } else {
    print_text(report);
    if (truth) print_comparison(*truth);
  }
  const int status = report_gaps(report, request);
  if (truth && !has_all_truth(truth->surface, arguments.truth, "the tracked surface")) {
    return kExitIncomplete;
  }
  return status;
}

}  // namespace

void add_track(CommandLine& line) {
  cli::Command command = line.add(
      "track", "Follow the surface of a take through its pulses (motion.v3d)",
      {"v3dctl track dancer", "v3dctl track dancer --frames 100:200 --json",
       "v3dctl track sim-01 --truth truth", "v3dctl track scans.v3d --meshes scans --height 1.8m",
       "v3dctl track kendo-07 --slurm --partition night"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take,
                     "The folder of a take, reconstructed with high quality; with --meshes, the "
                     "result: a file .v3d, or a folder for motion.v3d");
  command.add_option("--meshes", arguments->meshes,
                     "Track the meshes in this folder instead: one .obj or .ply for each pulse");
  command.add_option("--out", arguments->out, "The result (otherwise motion.v3d of the take)")
      .type_name("FILE");
  command
      .add_option("--truth", arguments->truth,
                  "Compare with the true surfaces and points of v3d-sim take --truth DIR")
      .type_name("DIR");
  command
      .add_option("--height", arguments->height,
                  "With --meshes: scale the meshes to this height (otherwise they are in metres)")
      .type_name("LEN");
  add_frames_option(command, arguments->frames);
  command.add_option("--triangles", arguments->triangles, "Triangles of a template")
      .check(cli::integer_in(1000, 1'000'000))
      .show_default();
  command
      .add_option("--step", arguments->step,
                  "Step of the coded positions: they differ by half of it at most")
      .type_name("LEN")
      .show_default();
  command
      .add_option("--without", arguments->without,
                  "For comparisons, track without: photometry, heterogeneity, fusion")
      .type_name("PART,...");
  command
      .add_option("--threads", arguments->threads,
                  "Worker threads (otherwise one per core); the result is the same")
      .check(cli::integer_in(1, 1024));
  add_task_options(command, arguments->tasks);
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
  add_task_command(line, kTrackTask, "A task of v3dctl track",
                   [](const std::string& folder, take::FrameRange shard, int threads) {
                     track_shard(TrackFolder(folder), shard, threads);
                   });
}

}  // namespace v3d::ctl
