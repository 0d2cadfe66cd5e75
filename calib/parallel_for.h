// The same work for several things at a time.
#pragma once

#include <functional>

namespace v3d::calib {

/// Calls work(0) ... work(count - 1) on so many threads; what is thrown for the lowest of them is
/// thrown here when all are done.
void on_threads(int threads, int count, const std::function<void(int)>& work);

}  // namespace v3d::calib
