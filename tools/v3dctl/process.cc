#include "v3dctl/process.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <stdexcept>

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

}  // namespace v3d::ctl
