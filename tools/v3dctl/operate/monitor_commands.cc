// health: every counter of every node.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "common/number_option.h"
#include "daemon/operator_client.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/live_screen.h"
#include "v3dctl/operate/not_verified.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

struct Options {
  bool json = false;
  bool watch = false;
  double timeout_s = 2.5;  // nodes report once a second
};

using Healths = std::map<std::string, HealthMessage>;

int show_once(const Studio& studio, const Options& options) {
  OperatorClient client(studio);
  tell_if_not_verified(client);
  const Healths health = client.health(Monotonic::now() + from_seconds(options.timeout_s));
  if (options.json) {
    std::printf("%s\n", health_json(client.nodes(), health).dump(2).c_str());
  } else {
    for (const std::string& line : health_lines(client.nodes(), health)) {
      std::printf("%s\n", line.c_str());
    }
  }
  return all_well(client.nodes(), health) ? kExitDone : kExitNotWhole;
}

void print_json_line(const StudioView& view) {
  std::printf("%s\n", health_json(view.nodes, view.health).dump().c_str());
  std::fflush(stdout);
}

int show_until_interrupted(const Studio& studio, const Options& options) {
  StudioWatcher watcher(studio);
  catch_interrupts();
  std::optional<LiveScreen> screen;
  if (!options.json) screen.emplace();
  MonotonicInstant next = Monotonic::now() + from_seconds(1);  // once every node may be heard
  while (!interrupted()) {
    watcher.listen();
    if (Monotonic::now() < next) continue;
    next += from_seconds(1);
    const StudioView& view = watcher.view();
    if (screen) {
      screen->show(health_lines(view.nodes, view.health));
    } else {
      print_json_line(view);
    }
  }
  return kExitDone;
}

}  // namespace

void add_health(CommandLine& line) {
  CLI::App* command = line.add("health", "Every counter of every node",
                               {"v3dctl health", "v3dctl health --json", "v3dctl health --watch"});
  auto options = std::make_shared<Options>();
  add_json_flag(command, options->json);
  command->add_flag("--watch", options->watch,
                    "Again every second until Ctrl-C (with --json: an object a line)");
  command->add_option("--timeout", options->timeout_s, "Give up after so many seconds")
      ->type_name("S")
      ->capture_default_str()
      ->check(number_in(0.1, 3600));
  line.on_run(command, [&line, options] {
    const Studio studio = line.studio();
    return options->watch ? show_until_interrupted(studio, *options) : show_once(studio, *options);
  });
}

}  // namespace v3d::ctl
