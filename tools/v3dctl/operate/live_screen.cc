#include "v3dctl/operate/live_screen.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace v3d::ctl {
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
