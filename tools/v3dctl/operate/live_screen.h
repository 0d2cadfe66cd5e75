// Terminal screen that is redrawn in place.
#pragma once

#include <string>
#include <vector>

namespace v3d::ctl {

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

}  // namespace v3d::ctl
