// Work for all cores that does not depend on which core does it.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace v3d::sim {

/// Calls work(i) once for every i < count, on as many threads as there are cores. `work` must not
/// throw. Returns when all are done.
template <class Work>
void for_each_index(size_t count, Work work) {
  std::atomic<size_t> next{0};
  const auto run = [&] {
    for (size_t i = next++; i < count; i = next++) {
      work(i);
    }
  };
  const size_t helpers = std::min<size_t>(count, std::max(1U, std::thread::hardware_concurrency()));
  std::vector<std::jthread> threads;
  for (size_t i = 1; i < helpers; ++i) {
    threads.emplace_back(run);
  }
  run();
}

}  // namespace v3d::sim
