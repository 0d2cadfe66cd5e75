// Console output for people: notes and progress on stderr. stdout is reserved for results.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace v3d {

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
  /// `what`: name of the work. `total`: number of steps; 0: unknown.
  Progress(std::string what, int64_t total);
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
  int64_t done_ = 0;
  int64_t printed_ = 0;
  bool terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_draw_;
};

/// The text of a bar, such as "[=====>    ]  50 %", with `width` characters between the brackets.
std::string progress_bar(int64_t done, int64_t total, int width);

}  // namespace v3d
