#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

#include "base/io/process.h"

namespace v3d {
namespace {

TEST(AvailableMemory, returns_the_value_of_the_kernel) {
  EXPECT_GT(available_memory(), 0);
  EXPECT_LT(available_memory(), std::numeric_limits<int64_t>::max());
}

}  // namespace
}  // namespace v3d
