// watch: the whole studio on one screen, and what happens in it.
#include <cstdio>

#include "base/error.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/live_screen.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/operate/watch_table.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

constexpr Duration kDrawEvery = std::chrono::milliseconds(500);
constexpr Duration kSumUpEvery = std::chrono::seconds(1);

void draw(const StudioView& view, LiveScreen& screen) {
  std::vector<std::string> lines;
  for (const WatchLine& line : watch_lines(view, screen.width(), screen.height())) {
    lines.push_back(line.text(screen.has_colours()));
  }
  screen.show(lines);
}

void draw_until_interrupted(StudioWatcher& watcher, LiveScreen& screen) {
  MonotonicInstant next = Monotonic::now() + kSumUpEvery;  // once every node may have been heard
  while (!interrupted()) {
    const bool news = !watcher.listen().empty();
    if (!news && Monotonic::now() < next) continue;
    draw(watcher.view(), screen);
    next = Monotonic::now() + kDrawEvery;
  }
}

/// For a pipe or a file: events, and the sum of the studio when it has changed.
void print_until_interrupted(StudioWatcher& watcher) {
  std::string told;
  MonotonicInstant next = Monotonic::now() + kSumUpEvery;
  while (!interrupted()) {
    for (const EventMessage& event : watcher.listen()) {
      std::printf("%s\n", event_line(event).text(false).c_str());
    }
    if (const std::string sum = summary_line(watcher.view());
        Monotonic::now() >= next && sum != told) {
      std::printf("%s\n", sum.c_str());
      told = sum;
      next = Monotonic::now() + kSumUpEvery;
    }
    std::fflush(stdout);
  }
}

}  // namespace

void add_watch(CommandLine& line) {
  CLI::App* command =
      line.add("watch", "Follow the studio and its alarms until Ctrl-C", {"v3dctl watch"});
  line.on_run(command, [&line] {
    StudioWatcher watcher(line.studio());
    catch_interrupts();
    LiveScreen screen;
    if (screen.is_terminal()) {
      draw_until_interrupted(watcher, screen);
    } else {
      print_until_interrupted(watcher);
    }
    return kExitDone;
  });
}

}  // namespace v3d::ctl
