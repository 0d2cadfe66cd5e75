#include "v3dctl/operate/live_screen.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace v3d::ctl {
namespace {

constexpr size_t kPlenty = 100'000;

bool stdout_can_redraw() {
  const char* term = std::getenv("TERM");
  return isatty(STDOUT_FILENO) && term && std::string_view(term) != "dumb";
}

winsize window() {
  winsize size{};
  ioctl(STDOUT_FILENO, TIOCGWINSZ, &size);
  return size;
}

}  // namespace

LiveScreen::LiveScreen() : terminal_(stdout_can_redraw()) {
  // The alternate screen, and no cursor (xterm's control sequences; console_codes(4)).
  if (terminal_) std::fputs("\033[?1049h\033[?25l", stdout);
}

LiveScreen::~LiveScreen() {
  if (!terminal_) return;
  std::fputs("\033[?25h\033[?1049l", stdout);
  for (const std::string& line : shown_) std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

bool LiveScreen::has_colours() const {
  const char* wish = std::getenv("NO_COLOR");
  return terminal_ && (wish == nullptr || *wish == '\0');
}

size_t LiveScreen::width() const {
  const size_t columns = terminal_ ? window().ws_col : 0;
  return columns > 0 ? columns : kPlenty;
}

size_t LiveScreen::height() const {
  const size_t rows = terminal_ ? window().ws_row : 0;
  return rows > 0 ? rows : kPlenty;
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
