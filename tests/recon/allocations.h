// Counts what a test allocates.
#pragma once

#include <cstdint>

namespace v3d {

/// Calls of operator new by this program so far. oneTBB takes the memory of its own tasks
/// elsewhere.
int64_t allocations();

}  // namespace v3d
