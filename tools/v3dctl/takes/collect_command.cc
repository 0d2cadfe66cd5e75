// takes collect: options and results of collect_takes().
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/core/name.h"
#include "common/console.h"
#include "v3dctl/takes/collect.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct CollectArguments {
  SharedTakesArguments takes;
  std::filesystem::path to;
  std::vector<std::string> from;
  std::string rsh;
};

TakeSource parse_source(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
    throw InputError("--from " + text + ": expected NODE=PLACE, such as cap01=/mnt/cap01/takes");
  }
  const TakeSource source{text.substr(0, equals), text.substr(equals + 1)};
  if (!is_file_name(source.node)) {
    throw InputError("--from " + text + ": '" + source.node + "' cannot be the name of a node");
  }
  return source;
}

bool is_whole(const CollectedTake& take) {
  return take.was_there || (take.problem.empty() && take.verification.whole());
}

std::string text_of(const CollectedTake& take) {
  if (take.was_there) return "take " + take.name + ": exists already";
  if (!take.problem.empty()) return "take " + take.name + ": not collected: " + take.problem;
  std::string text;
  for (const std::string& line : take.verification.disagreements) text += line + "\n";
  for (const std::string& line : take.verification.notes) text += "note: " + line + "\n";
  if (!take.meshes_of.empty()) {
    text += "mesh.v3d of " + take.meshes_of + ", which has most meshes\n";
  }
  return text + take.verification.ledger.verdict();
}

Json collected_json(const std::vector<CollectedTake>& takes) {
  Json list = Json::array();
  for (const CollectedTake& take : takes) {
    list.push_back({{"name", take.name},
                    {"collected", take.problem.empty()},
                    {"was_there", take.was_there},
                    {"problem", take.problem},
                    {"meshes_of", take.meshes_of},
                    {"complete", is_whole(take)},
                    {"disagreements", take.verification.disagreements},
                    {"notes", take.verification.notes}});
  }
  return {{"takes", list}};
}

int run_collect(const CommandLine& line, const CollectArguments& arguments) {
  CollectRequest request;
  for (const std::string& text : arguments.from) request.sources.push_back(parse_source(text));
  if (request.sources.empty()) request.sources = sources_of(line.studio());
  request.to = arguments.to;
  request.takes = arguments.takes->names;
  request.rsh = arguments.rsh;
  const std::vector<CollectedTake> takes = collect_takes(request);
  if (arguments.takes->json) {
    std::printf("%s\n", collected_json(takes).dump(2).c_str());
  } else {
    for (const CollectedTake& take : takes) std::printf("%s\n", text_of(take).c_str());
    if (takes.empty()) note("v3dctl: no node has a take");
  }
  return std::all_of(takes.begin(), takes.end(), is_whole) ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_takes_collect(CommandLine& line, CLI::App* takes, const SharedTakesArguments& shared) {
  CLI::App* command = add_takes_subcommand(
      takes, "collect", "Copy takes from all nodes into one folder and verify the copies",
      "v3dctl takes collect --to /mnt/archive kendo-07");
  auto arguments = std::make_shared<CollectArguments>();
  arguments->takes = shared;
  command->add_option("NAME", shared->names, "Takes (otherwise all that are not there yet)");
  command->add_option("--to", arguments->to, "The folder of the copies")
      ->type_name("DIR")
      ->required();
  command
      ->add_option("--from", arguments->from,
                   "A node and its takes: a folder, or HOST:FOLDER (otherwise the nodes of the "
                   "studio file)")
      ->type_name("NODE=PLACE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--rsh", arguments->rsh, "Remote shell of rsync (otherwise ssh)")
      ->type_name("COMMAND");
  line.on_run(command, [&line, arguments] { return run_collect(line, *arguments); });
}

}  // namespace v3d::ctl
