#include "common/console.h"

#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "base/core/text.h"

namespace v3d {

void note(const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); }

bool on_terminal() {
  const char* term = std::getenv("TERM");
  return isatty(STDERR_FILENO) && term && std::string_view(term) != "dumb";
}

StatusLine::~StatusLine() {
  if (terminal_ && !shown_.empty()) std::fputc('\n', stderr);
}

void StatusLine::show(const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  if (terminal_) {
    std::fprintf(stderr, "\r%s\033[K", text.c_str());
    std::fflush(stderr);
  } else if (text == shown_ || (!shown_.empty() && now - shown_at_ < std::chrono::seconds(1))) {
    return;
  } else {
    note(text);
  }
  shown_ = text;
  shown_at_ = now;
}

Progress::Progress(std::string what, int64_t total, std::string unit)
    : what_(std::move(what)), total_(total), unit_(std::move(unit)), terminal_(on_terminal()) {}

Progress::~Progress() {
  if (!terminal_ || !drawn_) return;
  draw();
  std::fputc('\n', stderr);
}

void Progress::advance(int64_t steps) {
  done_ += steps;
  if (!terminal_) return print_plain();
  const auto now = std::chrono::steady_clock::now();
  if (drawn_ && now - last_draw_ < std::chrono::milliseconds(100)) return;
  last_draw_ = now;
  draw();
}

void Progress::print_plain() {
  if (total_ == 1) return;  // a single step needs no progress
  const int64_t step = total_ > 0 ? std::max<int64_t>(1, total_ / 10) : 100;
  if (done_ - printed_ < step && done_ != total_) return;
  printed_ = done_;
  note(text());
}

void Progress::draw() {
  const std::string bar = total_ > 0 ? " " + progress_bar(done_, total_, 30) : "";
  std::fprintf(stderr, "\r%s%s\033[K", text().c_str(), bar.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

std::string Progress::text() const {
  const std::string of = total_ > 0 ? " of " + format_count(total_) : "";
  return what_ + " " + format_count(done_) + of + " " + unit_;
}

std::string progress_bar(int64_t done, int64_t total, int width) {
  const double part = total > 0 ? std::clamp(static_cast<double>(done) / total, 0.0, 1.0) : 0.0;
  const int filled = static_cast<int>(part * width);
  std::string bar(static_cast<size_t>(filled), '=');
  if (filled < width) bar += '>';
  bar.resize(static_cast<size_t>(width), ' ');
  const std::string percent = fmt::format("] {:3.0f} %", 100 * part);
  return "[" + bar + percent;
}

}  // namespace v3d

namespace v3d::ctl {
namespace {

/// Atomic, because the handler runs in any thread and other threads read the flag.
std::atomic<bool> g_interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler must not lock");

void set_interrupted(int) { g_interrupted = true; }

}  // namespace

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = set_interrupted;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // ignored after nohup
}

bool interrupted() { return g_interrupted; }

void stop_if_interrupted() {
  if (interrupted()) throw std::runtime_error("interrupted");
}

std::string host_name() {
  char text[256] = {};
  gethostname(text, sizeof text - 1);
  return text;
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024 / 1e6;
}

}  // namespace v3d::ctl
