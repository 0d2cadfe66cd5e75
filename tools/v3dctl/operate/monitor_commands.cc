// health and watch: counters of the nodes, and the state of the studio on one screen.
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/error.h"
#include "cli/command.h"
#include "common/console.h"
#include "daemon/control/operator_client.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

// Terminal screen that is redrawn in place.

/// On a terminal: shows lines on the alternate screen; the destructor restores the main screen and
/// prints the last lines there. On a pipe or file: prints all lines. One object at a time, one
/// thread.
class LiveScreen {
 public:
  LiveScreen();
  ~LiveScreen();
  LiveScreen(const LiveScreen&) = delete;
  LiveScreen& operator=(const LiveScreen&) = delete;

  /// Whether stdout is a terminal that can be redrawn.
  bool is_terminal() const { return terminal_; }
  /// Whether it is one and NO_COLOR is not set (no-color.org).
  bool has_colours() const;
  size_t width() const;   ///< columns; practically unlimited without a terminal
  size_t height() const;  ///< rows; practically unlimited without a terminal

  void show(const std::vector<std::string>& lines);

 private:
  const bool terminal_;
  std::vector<std::string> shown_;
};

namespace {

// --- health

struct HealthOptions {
  bool json = false;
  bool watch = false;
  double timeout_s = 2.5;  // nodes report once a second
};

int print_health(const Studio& studio, const HealthOptions& options) {
  control::OperatorClient client(studio);
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

void print_json_line(const StudioSnapshot& state) {
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
    const StudioSnapshot& state = monitor.state();
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

void draw_table(const StudioSnapshot& state, LiveScreen& screen) {
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
    for (const wire::EventMessage& event : monitor.poll()) {
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
  cli::Command command =
      line.add("health", "Print all counters of all nodes",
               {"v3dctl health", "v3dctl health --json", "v3dctl health --watch"});
  auto options = std::make_shared<HealthOptions>();
  add_json_flag(command, options->json);
  command.add_flag("--watch", options->watch,
                   "Repeat every second until Ctrl-C (with --json: one object a line)");
  command.add_option("--timeout", options->timeout_s, "Give up after this many seconds")
      .type_name("S")
      .show_default()
      .check(cli::number_in(0.1, 3600));
  line.on_run(command, [&line, options] {
    const Studio studio = line.studio();
    return options->watch ? show_health_until_interrupted(studio, *options)
                          : print_health(studio, *options);
  });
}

void add_watch(CommandLine& line) {
  cli::Command command =
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

namespace {

constexpr size_t kUnlimited = 100'000;

bool stdout_can_redraw() {
  const char* term = std::getenv("TERM");
  return isatty(STDOUT_FILENO) && term && std::string_view(term) != "dumb";
}

winsize window_size() {
  winsize size{};
  ioctl(STDOUT_FILENO, TIOCGWINSZ, &size);
  return size;
}

}  // namespace

LiveScreen::LiveScreen() : terminal_(stdout_can_redraw()) {
  // Alternate screen, hidden cursor (control sequences of xterm; console_codes(4)).
  if (terminal_) std::fputs("\033[?1049h\033[?25l", stdout);
}

LiveScreen::~LiveScreen() {
  if (!terminal_) return;
  std::fputs("\033[?25h\033[?1049l", stdout);
  for (const std::string& line : shown_) std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

bool LiveScreen::has_colours() const {
  const char* no_colour = std::getenv("NO_COLOR");
  return terminal_ && (no_colour == nullptr || *no_colour == '\0');
}

size_t LiveScreen::width() const {
  const size_t columns = terminal_ ? window_size().ws_col : 0;
  return columns > 0 ? columns : kUnlimited;
}

size_t LiveScreen::height() const {
  const size_t rows = terminal_ ? window_size().ws_row : 0;
  return rows > 0 ? rows : kUnlimited;
}

void LiveScreen::show(const std::vector<std::string>& lines) {
  if (!terminal_) {
    for (const std::string& line : lines) std::printf("%s\n", line.c_str());
    std::fflush(stdout);
    return;
  }
  std::string text = "\033[H";
  const size_t rows = height();
  for (size_t i = 0; i < lines.size() && i < rows; ++i) {
    text += lines[i] + "\033[K" + (i + 1 < rows ? "\r\n" : "");
  }
  text += "\033[J";
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
  shown_ = lines;
}

}  // namespace v3d::ctl
