// A parallel loop that rethrows exceptions.
#pragma once

#include <atomic>
#include <exception>
#include <future>
#include <vector>

namespace v3d::calib {

/// Calls work(0) ... work(count - 1), each once, on `threads` threads, and waits for all of them.
/// Rethrows the exception of the lowest index that threw one.
template <class Work>
void parallel_for(int threads, int count, const Work& work) {
  std::vector<std::exception_ptr> errors(static_cast<size_t>(count));
  std::atomic<int> next = 0;
  std::vector<std::future<void>> workers;
  for (int t = 0; t < threads; ++t) {
    workers.push_back(std::async(std::launch::async, [&] {
      for (int i = next++; i < count; i = next++) {
        try {
          work(i);
        } catch (...) {
          errors[static_cast<size_t>(i)] = std::current_exception();
        }
      }
    }));
  }
  for (std::future<void>& worker : workers) worker.get();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace v3d::calib
