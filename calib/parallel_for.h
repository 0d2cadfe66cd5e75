// A parallel loop that rethrows exceptions. The adapter of oneTBB.
#pragma once

#include <functional>

namespace v3d::calib {

/// Calls work(0) ... work(count - 1), each once, on at most `threads` threads (1 or more), and
/// waits for all calls. Rethrows the exception of the lowest index that threw one, so that the
/// result does not depend on the order of the calls.
void parallel_for(int threads, int count, const std::function<void(int)>& work);

}  // namespace v3d::calib
