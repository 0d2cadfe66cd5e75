// Lines on a terminal that are redrawn where they stand.
#pragma once

#include <string>
#include <vector>

namespace v3d::ctl {

/// On a terminal: a screen of its own, which goes when this goes, and the last lines are printed
/// where the person was before. Elsewhere lines are printed, one below the other. One thread; one
/// at a time.
class LiveScreen {
 public:
  LiveScreen();
  ~LiveScreen();
  LiveScreen(const LiveScreen&) = delete;
  LiveScreen& operator=(const LiveScreen&) = delete;

  /// stdout is a terminal that can do so.
  bool is_terminal() const { return terminal_; }
  /// It is, and nobody wishes no colours (NO_COLOR, no-color.org).
  bool has_colours() const;
  size_t width() const;   ///< columns; very many where there is no terminal
  size_t height() const;  ///< rows; very many where there is no terminal

  void show(const std::vector<std::string>& lines);

 private:
  const bool terminal_;
  std::vector<std::string> shown_;
};

}  // namespace v3d::ctl
