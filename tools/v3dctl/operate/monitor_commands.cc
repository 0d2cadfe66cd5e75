// health and watch: counters of the nodes, and the state of the studio on one screen.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/error.h"
#include "common/number_option.h"
#include "daemon/control/operator_client.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/live_screen.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/operate/watch_table.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

// --- health

struct HealthOptions {
  bool json = false;
  bool watch = false;
  double timeout_s = 2.5;  // nodes report once a second
};

int print_health(const Studio& studio, const HealthOptions& options) {
  OperatorClient client(studio);
  report_if_not_verified(client);
  const auto health = client.health(Monotonic::now() + from_seconds(options.timeout_s));
  if (options.json) {
    std::printf("%s\n", health_json(client.nodes(), health).dump(2).c_str());
  } else {
    for (const std::string& line : health_lines(client.nodes(), health)) {
      std::printf("%s\n", line.c_str());
    }
  }
  return all_well(client.nodes(), health) ? kExitDone : kExitIncomplete;
}

void print_json_line(const StudioState& state) {
  std::printf("%s\n", health_json(state.nodes, state.health).dump().c_str());
  std::fflush(stdout);
}

int show_health_until_interrupted(const Studio& studio, const HealthOptions& options) {
  StudioMonitor monitor(studio);
  catch_interrupts();
  std::optional<LiveScreen> screen;
  if (!options.json) screen.emplace();
  MonotonicInstant next =
      Monotonic::now() + from_seconds(1);  // every node has reported once by then
  while (!interrupted()) {
    monitor.poll();
    if (Monotonic::now() < next) continue;
    next += from_seconds(1);
    const StudioState& state = monitor.state();
    if (screen) {
      screen->show(health_lines(state.nodes, state.health));
    } else {
      print_json_line(state);
    }
  }
  return kExitDone;
}

// --- watch

constexpr Duration kRedrawPeriod = std::chrono::milliseconds(500);
constexpr Duration kSummaryPeriod = std::chrono::seconds(1);

void draw_table(const StudioState& state, LiveScreen& screen) {
  std::vector<std::string> lines;
  for (const WatchLine& line : watch_lines(state, screen.width(), screen.height())) {
    lines.push_back(line.text(screen.has_colours()));
  }
  screen.show(lines);
}

void redraw_until_interrupted(StudioMonitor& monitor, LiveScreen& screen) {
  MonotonicInstant next =
      Monotonic::now() + kSummaryPeriod;  // every node has reported once by then
  while (!interrupted()) {
    const bool has_events = !monitor.poll().empty();
    if (!has_events && Monotonic::now() < next) continue;
    draw_table(monitor.state(), screen);
    next = Monotonic::now() + kRedrawPeriod;
  }
}

/// For a pipe or a file: prints events, and the summary when it has changed.
void print_until_interrupted(StudioMonitor& monitor) {
  std::string printed;
  MonotonicInstant next = Monotonic::now() + kSummaryPeriod;
  while (!interrupted()) {
    for (const EventMessage& event : monitor.poll()) {
      std::printf("%s\n", event_line(event).text(false).c_str());
    }
    if (const std::string summary = summary_line(monitor.state());
        Monotonic::now() >= next && summary != printed) {
      std::printf("%s\n", summary.c_str());
      printed = summary;
      next = Monotonic::now() + kSummaryPeriod;
    }
    std::fflush(stdout);
  }
}

}  // namespace

void add_health(CommandLine& line) {
  CLI::App* command = line.add("health", "Print all counters of all nodes",
                               {"v3dctl health", "v3dctl health --json", "v3dctl health --watch"});
  auto options = std::make_shared<HealthOptions>();
  add_json_flag(command, options->json);
  command->add_flag("--watch", options->watch,
                    "Repeat every second until Ctrl-C (with --json: one object a line)");
  command->add_option("--timeout", options->timeout_s, "Give up after this many seconds")
      ->type_name("S")
      ->capture_default_str()
      ->check(number_in(0.1, 3600));
  line.on_run(command, [&line, options] {
    const Studio studio = line.studio();
    return options->watch ? show_health_until_interrupted(studio, *options)
                          : print_health(studio, *options);
  });
}

void add_watch(CommandLine& line) {
  CLI::App* command =
      line.add("watch", "Show the studio and its alarms until Ctrl-C", {"v3dctl watch"});
  line.on_run(command, [&line] {
    StudioMonitor monitor(line.studio());
    catch_interrupts();
    LiveScreen screen;
    if (screen.is_terminal()) {
      redraw_until_interrupted(monitor, screen);
    } else {
      print_until_interrupted(monitor);
    }
    return kExitDone;
  });
}

}  // namespace v3d::ctl
