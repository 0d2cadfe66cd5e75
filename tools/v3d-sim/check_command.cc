#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/core/units.h"
#include "sim/cameras/exposure_record.h"
#include "v3d-sim/commands.h"
#include "v3d-sim/take_check.h"

namespace v3d::sim {
namespace {

struct Arguments {
  std::string take;
  std::string exposures;
  bool json = false;
};

int run(const Arguments& arguments) {
  const TakeCheck check = check_take(arguments.take, load_exposures(arguments.exposures));
  for (const std::string& problem : check.problems) {
    std::cerr << problem << '\n';
  }
  if (arguments.json) {
    std::cout << nlohmann::ordered_json{{"frames_received", check.frames_received},
                                        {"frames_missing", check.frames_missing},
                                        {"frames_mislabelled", check.frames_mislabelled},
                                        {"mislabelled_silently", check.mislabelled_not_suspect}}
                     .dump()
              << '\n';
  } else {
    std::cout << format_count(check.frames_received) << " frames received, "
              << format_count(check.frames_missing) << " missing, "
              << format_count(check.frames_mislabelled) << " mislabelled, "
              << format_count(check.mislabelled_not_suspect) << " of them not suspect\n";
  }
  return check.whole() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_check_command(CLI::App& app, int& status) {
  CLI::App& command = *app.add_subcommand(
      "check",
      "Compare a recorded take with the simulator's record of the edge that each image shows");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "Folder of the take")->required();
  command.add_option("--exposures", arguments->exposures, "exposures.csv of the simulated studio")
      ->required();
  command.add_flag("--json", arguments->json, "One JSON object on stdout");
  command.footer(
      "Exit status 3 when a frame is missing or mislabelled.\n"
      "Example:\n"
      "  v3d-sim check studio/kendo-01 --exposures studio/exposures.csv --json");
  command.callback([arguments, &status] { status = run(*arguments); });
}

}  // namespace v3d::sim
