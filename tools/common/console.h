// Console output, interrupts by the user, local time, memory of the process.
#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>
#include <string>

#include "base/core/time.h"

namespace v3d {

// Console output for people: notes and progress on stderr. stdout is reserved for results.

/// Prints one line on stderr.
void note(const std::string& line);

/// True when stderr is a terminal that can redraw a line.
bool on_terminal();

/// A status line. On a terminal it is redrawn; otherwise it is printed when it has changed, at most
/// once a second. The destructor ends the line. One thread.
class StatusLine {
 public:
  StatusLine() : terminal_(on_terminal()) {}
  ~StatusLine();
  StatusLine(const StatusLine&) = delete;
  StatusLine& operator=(const StatusLine&) = delete;

  void show(const std::string& text);

 private:
  const bool terminal_;
  std::string shown_;
  std::chrono::steady_clock::time_point shown_at_;
};

/// Progress of long work: a bar on a terminal, otherwise a plain line for every tenth of the work.
/// The destructor ends the line. One thread.
class Progress {
 public:
  /// `what`: name of the work. `total`: number of steps; 0: unknown. `unit`: what a step is, in the
  /// plural.
  Progress(std::string what, int64_t total, std::string unit = "frames");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(int64_t steps = 1);

 private:
  void draw();
  void print_plain();
  std::string text() const;

  std::string what_;
  int64_t total_;
  std::string unit_;
  int64_t done_ = 0;
  int64_t printed_ = 0;
  bool terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_draw_;
};

/// The text of a bar, such as "[=====>    ]  50 %", with `width` characters between the brackets.
std::string progress_bar(int64_t done, int64_t total, int width);

// Local date and time of an instant as text.

/// Formats `instant` in the time zone of this PC. `format` is that of strftime(); the result must
/// have at most 31 characters.
inline std::string local_time(RealtimeInstant instant, const char* format) {
  const std::time_t seconds = to_ns(instant) / 1'000'000'000;
  std::tm parts{};
  localtime_r(&seconds, &parts);
  char text[32];
  return {text, std::strftime(text, sizeof text, format, &parts)};
}

}  // namespace v3d

namespace v3d::ctl {

// Signals and host name of this process.

/// Installs handlers of SIGINT, SIGTERM and, unless it is ignored, SIGHUP that only set a flag.
/// Long work then checks the flag after each frame and removes its temporary files before it ends.
void catch_interrupts();
/// Whether one of these signals has arrived since catch_interrupts(). Thread-safe.
bool interrupted();
/// Throws std::runtime_error("interrupted") if interrupted().
void stop_if_interrupted();

std::string host_name();

/// Largest resident memory of this process so far, 10^6 bytes.
double peak_rss_mb();

}  // namespace v3d::ctl
