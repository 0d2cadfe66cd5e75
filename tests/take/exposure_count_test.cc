#include <gtest/gtest.h>

#include <initializer_list>

#include "take/ledger/ledger.h"

namespace v3d::take {
namespace {

int64_t exposed(std::initializer_list<uint64_t> counters) {
  ExposureCount count;
  for (const uint64_t counter : counters) count.add(counter);
  return count.exposed();
}

TEST(ExposureCount, counts_lost_frames) {
  EXPECT_EQ(exposed({}), 0);
  EXPECT_EQ(exposed({7}), 1);
  EXPECT_EQ(exposed({7, 8, 11}), 5);
}

TEST(ExposureCount, starts_a_new_run_when_the_counter_is_reset) {
  EXPECT_EQ(exposed({100, 101, 104, 0, 2}), 5 + 3);
  EXPECT_EQ(exposed({0, 1, 9'000'000'000}), 3);
}

TEST(ExposureCount, accepts_frames_out_of_order) { EXPECT_EQ(exposed({10, 12, 11, 13}), 4); }

}  // namespace
}  // namespace v3d::take
