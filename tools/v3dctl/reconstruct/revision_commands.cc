// camera-colours: adds the colours of every camera to the meshes of a take. performers: labels the
// meshes of a take with the performer that they show.
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/text.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/take_revision.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct CameraColourArguments {
  std::filesystem::path take;
  int kilobytes = 120;
  bool remove = false;
  bool json = false;
};

void print_json(const CameraColourReport& report) {
  const Json json = {{"frames", report.frames},
                     {"undecodable", report.undecodable},
                     {"without", report.without},
                     {"mean_bytes", report.mean_bytes},
                     {"mean_frame_bytes", report.mean_frame_bytes},
                     {"mean_step", report.mean_step}};
  fmt::print("{}\n", json.dump(2));
}

void print_text(const CameraColourReport& report) {
  fmt::print("{} of {:.1f} kB (mean)\n", count_of(report.frames, "frame"),
             report.mean_frame_bytes / 1000);
  if (report.mean_bytes > 0) {
    fmt::print("cameras      {:.1f} kB a frame (mean), step of luma {:.1f}\n",
               report.mean_bytes / 1000, report.mean_step);
  }
  if (report.undecodable > 0) {
    fmt::print("damaged      {}\n", count_of(report.undecodable, "frame"));
  }
}

int run(const CameraColourArguments& arguments) {
  catch_interrupts();
  const size_t max_bytes = arguments.remove ? 0 : 1000 * static_cast<size_t>(arguments.kilobytes);
  std::optional<Progress> progress;
  const CameraColourReport report = add_camera_colours(
      arguments.take, max_bytes, [&](int64_t frames) { progress.emplace("colours", frames); },
      [&] { progress->advance(); });
  progress.reset();
  arguments.json ? print_json(report) : print_text(report);
  int status = report.undecodable > 0 ? kExitIncomplete : kExitDone;
  if (!arguments.remove && report.without > 0) {
    note(
        fmt::format("v3dctl: {} without colours of cameras: a raw frame is missing or damaged, or "
                    "the mesh is too large; see v3dctl verify",
                    count_of(report.without, "frame")));
    status = kExitIncomplete;
  }
  return status;
}

}  // namespace

void add_camera_colours(CommandLine& line) {
  cli::Command command = line.add(
      "camera-colours",
      "Keep the colours of every camera in the meshes of a take, for view-dependent playback "
      "without raw frames",
      {"v3dctl camera-colours dancer", "v3dctl camera-colours dancer --kilobytes 60",
       "v3dctl camera-colours dancer --remove"});
  auto arguments = std::make_shared<CameraColourArguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  command
      .add_option("--kilobytes", arguments->kilobytes,
                  "At most this many kB (1,000 bytes) a frame for the colours of cameras")
      .type_name("KB")
      .check(cli::integer_in(1, 100'000))
      .show_default();
  command.add_flag("--remove", arguments->remove,
                   "Remove the colours of cameras; needs no raw frames");
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

namespace {

struct PerformersArguments {
  std::filesystem::path take;
  bool json = false;
};

Json to_json(const PerformersReport& report) {
  Json performers = Json::array();
  for (const PerformerPulses& performer : report.performers) {
    performers.push_back({{"performer", performer.identity},
                          {"first_pulse", performer.first},
                          {"last_pulse", performer.last},
                          {"pulses", performer.pulses},
                          {"mean_vertices", performer.mean_vertices}});
  }
  return {{"frames", report.frames},
          {"undecodable", report.undecodable},
          {"unlabelled", report.unlabelled},
          {"performers", performers}};
}

void print_text(const PerformersReport& report) {
  fmt::print("{}, {}\n", count_of(report.frames, "frame"),
             count_of(std::ssize(report.performers), "performer"));
  for (const PerformerPulses& performer : report.performers) {
    fmt::print("performer {}  pulses {} to {}, in {} of them, {} vertices (mean)\n",
               performer.identity, format_count(performer.first), format_count(performer.last),
               format_count(performer.pulses),
               format_count(static_cast<int64_t>(performer.mean_vertices)));
  }
  if (report.unlabelled > 0) {
    fmt::print("unlabelled   {:.2f} % of the vertices\n", 100 * report.unlabelled);
  }
  if (report.undecodable > 0) {
    fmt::print("damaged      {} without labels\n", count_of(report.undecodable, "frame"));
  }
}

int run(const PerformersArguments& arguments) {
  catch_interrupts();
  std::optional<Progress> progress;
  const PerformersReport report = label_performers(
      arguments.take, [&](int64_t frames) { progress.emplace("performers", frames); },
      [&] { progress->advance(); });
  progress.reset();
  if (arguments.json) {
    fmt::print("{}\n", to_json(report).dump(2));
  } else {
    print_text(report);
  }
  return report.undecodable > 0 ? kExitIncomplete : kExitDone;
}

}  // namespace

void add_performers(CommandLine& line) {
  cli::Command command = line.add(
      "performers", "Follow each performer through the meshes of a take and label his vertices",
      {"v3dctl performers fight",
       "v3dctl export fight --format glb --performer 2 --frames 12 second.glb"});
  auto arguments = std::make_shared<PerformersArguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
