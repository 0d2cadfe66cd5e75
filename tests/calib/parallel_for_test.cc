#include "calib/parallel_for.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "support/message_of.h"

namespace v3d::calib {
namespace {

TEST(ParallelFor, calls_each_index_once_with_any_number_of_threads) {
  for (const int threads : {1, 2, 64}) {
    std::vector<int> calls(1000, 0);
    parallel_for(threads, 1000, [&](int i) { ++calls[static_cast<size_t>(i)]; });
    EXPECT_EQ(calls, std::vector<int>(1000, 1));
  }
  parallel_for(2, 0, [](int) { FAIL(); });
}

TEST(ParallelFor, rethrows_the_exception_of_the_lowest_index_after_all_calls) {
  std::vector<int> calls(100, 0);
  EXPECT_EQ(test::message_of<std::runtime_error>([&] {
              parallel_for(2, 100, [&](int i) {
                ++calls[static_cast<size_t>(i)];
                if (i == 17 || i >= 70) throw std::runtime_error(std::to_string(i));
              });
            }),
            "17");
  EXPECT_EQ(calls, std::vector<int>(100, 1));
}

}  // namespace
}  // namespace v3d::calib
