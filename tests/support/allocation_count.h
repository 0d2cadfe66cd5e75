// Counter of the allocations of a test program, which is linked with v3d_test_allocations.
#pragma once

#include <cstdint>

namespace v3d::test {

/// Number of calls of operator new since the program started, by all threads.
int64_t allocations();

}  // namespace v3d::test
