// Counters of the allocations of a test program, which is linked with v3d_test_allocations, and
// exhausted memory.
#pragma once

#include <cstdint>

namespace v3d::test {

/// Number of calls of operator new since the program started, by all threads.
int64_t allocations();
/// Bytes that operator new has returned and that were not yet deleted, and their maximum since the
/// last call of forget_peak().
int64_t live_bytes();
int64_t peak_bytes();
void forget_peak();
/// Makes the `n`-th next call of operator new throw std::bad_alloc, and no other; 0: none.
void fail_allocation(int64_t n);

}  // namespace v3d::test
