// takes clap: the offset between sound and pictures.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "v3dctl/options.h"
#include "v3dctl/takes/clap.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

std::string text_of(const std::string& name, const std::optional<ClapOffset>& clap) {
  return "take " + name + ": " + (clap ? clap_text(*clap) : "no clap in its sound");
}

Json json_of(const std::string& name, const std::optional<ClapOffset>& clap) {
  Json json = {{"name", name}};
  json.update(clap_json(clap));
  return json;
}

int run_clap(const CommandLine& line, const TakesArguments& arguments) {
  Json claps = Json::array();
  bool all_found = true;
  for (const take::TakeListing& take : named_takes(line, arguments)) {
    const std::optional<ClapOffset> clap = find_take_clap(take.paths);
    all_found = all_found && clap && !clap->cameras.empty();
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
