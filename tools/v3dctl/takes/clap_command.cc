// takes clap: the offset between sound and pictures.
#include <fmt/core.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "v3dctl/options.h"
#include "v3dctl/takes/clap.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

bool has_offset(const std::optional<TakeClap>& clap) { return clap && clap->picture_pulse; }

std::string text_of(const std::string& name, const std::optional<TakeClap>& clap) {
  if (!clap) return "take " + name + ": no clap in its sound";
  const std::string text = fmt::format("take {}: clap at pulse {:.2f}", name, clap->sound_pulse);
  if (!has_offset(clap)) return text + "; no camera shows a motion that stops there";
  const double offset_ms = 1000 * clap->offset_s();
  return fmt::format("{}; the sound is {:.0f} ms {} than the pictures, +-{:.0f} ms, by {} cameras",
                     text, std::abs(offset_ms), offset_ms < 0 ? "earlier" : "later",
                     1000 * clap->uncertainty_s(), clap->cameras);
}

Json json_of(const std::string& name, const std::optional<TakeClap>& clap) {
  Json json = {{"name", name}, {"sound_pulse", nullptr}, {"picture_pulse", nullptr},
               {"cameras", 0}, {"offset_ms", nullptr},   {"uncertainty_ms", nullptr}};
  if (!clap) return json;
  json["sound_pulse"] = clap->sound_pulse;
  json["cameras"] = clap->cameras;
  if (!has_offset(clap)) return json;
  json["picture_pulse"] = *clap->picture_pulse;
  json["offset_ms"] = 1000 * clap->offset_s();
  json["uncertainty_ms"] = 1000 * clap->uncertainty_s();
  return json;
}

int run_clap(const CommandLine& line, const TakesArguments& arguments) {
  Json claps = Json::array();
  bool all_found = true;
  for (const take::TakeListing& take : named_takes(line, arguments)) {
    const std::optional<TakeClap> clap = find_take_clap(take.paths);
    all_found = all_found && has_offset(clap);
    claps.push_back(json_of(take.info.name, clap));
    if (!arguments.json) std::printf("%s\n", text_of(take.info.name, clap).c_str());
  }
  if (arguments.json) std::printf("%s\n", Json{{"claps", std::move(claps)}}.dump(2).c_str());
  return all_found ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_takes_clap(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared) {
  cli::Command command = add_takes_subcommand(
      takes, "clap", "Report how much later a clap is in the sound of takes than in their pictures",
      "v3dctl takes clap kendo-07");
  add_names_option(command, shared);
  line.on_run(command, [&line, shared] { return run_clap(line, *shared); });
}

}  // namespace v3d::ctl
