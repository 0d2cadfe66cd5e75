#include "v3d-sim/progress.h"

#include <unistd.h>

#include <cstdio>

namespace v3d::sim {

Progress::Progress(std::string what, int64_t total)
    : what_(std::move(what)), total_(total), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (terminal_ && last_shown_ >= 0) {
    std::fputc('\n', stderr);
  }
}

void Progress::done(int64_t count) {
  const int64_t step = terminal_ ? count : (total_ > 0 ? 10 * count / total_ : 10);
  if (step == last_shown_) {
    return;
  }
  last_shown_ = step;
  std::fprintf(stderr, "%s%s %lld of %lld%s", terminal_ ? "\r" : "", what_.c_str(),
               static_cast<long long>(count), static_cast<long long>(total_),
               terminal_ ? "\x1b[K" : "\n");
}

}  // namespace v3d::sim
