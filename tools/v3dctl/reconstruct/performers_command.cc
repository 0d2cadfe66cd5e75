// performers: labels the meshes of a take with the performer that they show.
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/text.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/take_performers.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
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

int run(const Arguments& arguments) {
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
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
