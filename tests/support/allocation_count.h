// A program that is linked with this counts its allocations.
#pragma once

#include <cstdint>

namespace v3d::test {

/// Calls of operator new since the program began, by all threads.
int64_t allocations();

}  // namespace v3d::test
