// A parallel loop over indices.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace v3d::sim {

/// Calls work(i) once for each i < count, with one thread per core, and waits for all calls. `work`
/// must not throw.
template <class Work>
void for_each_index(size_t count, Work work) {
  std::atomic<size_t> next{0};
  const auto run = [&] {
    for (size_t i = next++; i < count; i = next++) {
      work(i);
    }
  };
  const size_t thread_count =
      std::min<size_t>(count, std::max(1U, std::thread::hardware_concurrency()));
  std::vector<std::jthread> threads;
  for (size_t i = 1; i < thread_count; ++i) {
    threads.emplace_back(run);
  }
  run();
}

}  // namespace v3d::sim
