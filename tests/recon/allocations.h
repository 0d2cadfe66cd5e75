// Counter of memory allocations for tests.
#pragma once

#include <cstdint>

namespace v3d::recon {

/// Number of calls of operator new by this program so far. oneTBB allocates its tasks in another
/// way.
int64_t allocations();

}  // namespace v3d::recon
