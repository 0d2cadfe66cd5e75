#include "v3dctl/process.h"

#include <atomic>
#include <csignal>
#include <stdexcept>

namespace v3d::ctl {
namespace {

/// Atomic, for the signal reaches any thread, and others look.
std::atomic<bool> g_interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal's handler may not wait");

void remember(int) { g_interrupted = true; }

}  // namespace

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = remember;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool interrupted() { return g_interrupted; }

void stop_if_interrupted() {
  if (interrupted()) throw std::runtime_error("interrupted");
}

}  // namespace v3d::ctl
