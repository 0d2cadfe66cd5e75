#include "calib/parallel_for.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <vector>

namespace v3d::calib {

void parallel_for(int threads, int count, const std::function<void(int)>& work) {
  // oneTBB itself would cancel the loop and rethrow the exception that came first.
  std::vector<std::exception_ptr> errors(static_cast<size_t>(count));
  // oneTBB prints a warning when it is asked for more threads than the machine has.
  tbb::task_arena(std::min(threads, tbb::info::default_concurrency())).execute([&] {
    tbb::parallel_for(0, count, [&](int i) {
      try {
        work(i);
      } catch (...) {
        errors[static_cast<size_t>(i)] = std::current_exception();
      }
    });
  });
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace v3d::calib
