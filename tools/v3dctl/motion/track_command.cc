// track: follows the surface of a take through its pulses.
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/motion/take_motion.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::filesystem::path take, meshes, out;
  std::string frames, without, height, step = "0.5mm";
  int64_t triangles = 30'000;
  int threads = 0;
  bool json = false;
};

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

TrackRequest request_of(const Arguments& arguments) {
  if (arguments.take.empty() == arguments.meshes.empty()) {
    throw InputError("expected one input: the folder of a take, or --meshes DIR");
  }
  if (!arguments.meshes.empty() && arguments.out.empty()) {
    throw InputError("--meshes needs --out FILE for the result");
  }
  TrackRequest request;
  request.meshes_only = arguments.take.empty();
  request.input = request.meshes_only ? arguments.meshes : arguments.take;
  request.out = arguments.out;
  if (!arguments.height.empty()) request.height_m = parse_length(arguments.height);
  request.frames = parse_frame_range(arguments.frames);
  request.tracking = tracking_of(arguments);
  request.step_m = parse_length(arguments.step);
  request.threads = arguments.threads;
  return request;
}

Json to_json(const TrackReport& report) {
  Json segments = Json::array();
  for (const TrackedSegmentReport& segment : report.segments) {
    segments.push_back({{"first_pulse", segment.first},
                        {"last_pulse", segment.last},
                        {"key_pulse", segment.key},
                        {"pulses", segment.pulses},
                        {"vertices", segment.vertices},
                        {"triangles", segment.triangles},
                        {"residual_p50_mm", segment.residual_p50_mm},
                        {"residual_p90_mm", segment.residual_p90_mm},
                        {"max_far", segment.far},
                        {"matched_patches", segment.matched_patches},
                        {"patch_correlation", segment.patch_correlation}});
  }
  Json untracked = Json::array();
  for (const UntrackedReport& gap : report.untracked) {
    untracked.push_back(
        {{"first_pulse", gap.first}, {"last_pulse", gap.last}, {"reason", gap.reason}});
  }
  return {{"pulses", report.pulses},
          {"segments", segments},
          {"untracked", untracked},
          {"bytes", report.bytes},
          {"template_bytes", report.template_bytes},
          {"position_bytes", report.position_bytes},
          {"colour_bytes", report.colour_bytes},
          {"confidence_bytes", report.confidence_bytes},
          {"seconds", report.seconds},
          {"peak_rss_mb", report.peak_rss_mb}};
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

int run(const Arguments& arguments) {
  const TrackRequest request = request_of(arguments);
  catch_interrupts();
  std::optional<Progress> progress;
  int64_t turns = 0;
  const TrackReport report = track_take(
      request,
      // A pulse is read for the choice of key pulses, and in each of two passes; once more where a
      // segment ends.
      [&](int64_t pulses) { progress.emplace("track", turns = 3 * pulses); },
      [&] {
        if (turns-- > 0) progress->advance();
      });
  progress.reset();
  if (arguments.json) {
    fmt::print("{}\n", to_json(report).dump(2));
  } else {
    print_text(report);
  }
  return kExitDone;
}

}  // namespace

void add_track(CommandLine& line) {
  cli::Command command =
      line.add("track", "Follow the surface of a take through its pulses (motion.v3d)",
               {"v3dctl track dancer", "v3dctl track dancer --frames 100:200 --json",
                "v3dctl track --meshes scans --height 1.8m --out scans.v3d"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take,
                     "The folder of a take, reconstructed with high quality");
  command.add_option("--meshes", arguments->meshes,
                     "Track the meshes in this folder instead: one .obj or .ply for each pulse");
  command.add_option("--out", arguments->out, "The result (otherwise motion.v3d of the take)")
      .type_name("FILE");
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
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
