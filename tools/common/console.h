// What a person reads: notes and progress on stderr, so that stdout stays for results.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace v3d {

/// One line on stderr.
void note(const std::string& line);

/// stderr is a terminal that can redraw a line.
bool on_terminal();

/// A line that is redrawn on a terminal; else printed when it has changed, at most once a second.
/// One thread. Ends its line when it is destroyed.
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

/// How far a long piece of work has come: a bar on a terminal, else a plain line every tenth of the
/// work. One thread. Ends its line when it is destroyed.
class Progress {
 public:
  /// `total` 0: not known in advance.
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

/// "[=====>    ]  50 %": the bar alone, `width` characters between the brackets.
std::string progress_bar(int64_t done, int64_t total, int width);

}  // namespace v3d
