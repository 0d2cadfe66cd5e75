// Counts what this test program asks of the heap.
#pragma once

#include <cstdint>

namespace v3d::test {

/// Calls of operator new since the program began, by any thread.
int64_t allocations();

}  // namespace v3d::test
