// Program with threads that are interrupted by signals while they allocate memory. The handler
// writes to an eventfd, as those of the daemons do. Exit status 0: every write was done.
#include <malloc.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <thread>

namespace {

constexpr int kThreads = 300;
constexpr int kSecondsUntilKilled = 60;

int g_event = -1;
std::atomic<bool> g_handled = false;

void on_signal(int) {
  const uint64_t one = 1;
  g_handled = write(g_event, &one, sizeof(one)) == sizeof(one);
}

/// Allocates, in blocks that take the lock of malloc, until the signal was handled.
void allocate(std::atomic<bool>& began) {
  while (!g_handled) {
    void* volatile block = std::malloc(4000);  // a call that the compiler must not leave out
    std::free(block);
    began = true;
  }
}

}  // namespace

int main() {
  alarm(kSecondsUntilKilled);
  mallopt(M_ARENA_MAX, 1);
  g_event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::signal(SIGUSR1, on_signal);
  for (int i = 0; i < kThreads; ++i) {
    g_handled = false;
    std::atomic<bool> began = false;
    std::thread thread(allocate, std::ref(began));
    while (!began) std::this_thread::yield();
    pthread_kill(thread.native_handle(), SIGUSR1);
    thread.join();
  }
  return 0;
}
