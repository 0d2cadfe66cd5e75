// Counts the heap allocations of the test program.
#pragma once

#include <cstdint>

namespace v3d::test {

/// Number of calls of operator new since the program started, by all threads.
int64_t allocations();

}  // namespace v3d::test
