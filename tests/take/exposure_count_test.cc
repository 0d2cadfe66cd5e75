#include "take/ledger/exposure_count.h"

#include <gtest/gtest.h>

#include <initializer_list>

namespace v3d {
namespace {

int64_t exposed(std::initializer_list<uint64_t> counters) {
  ExposureCount count;
  for (const uint64_t counter : counters) count.add(counter);
  return count.exposed();
}

TEST(ExposureCount, counts_frames_that_were_lost_on_their_way) {
  EXPECT_EQ(exposed({}), 0);
  EXPECT_EQ(exposed({7}), 1);
  EXPECT_EQ(exposed({7, 8, 11}), 5);
}

TEST(ExposureCount, begins_anew_with_the_camera) {
  EXPECT_EQ(exposed({100, 101, 104, 0, 2}), 5 + 3);
  EXPECT_EQ(exposed({0, 1, 9'000'000'000}), 3);
}

TEST(ExposureCount, takes_frames_out_of_order) { EXPECT_EQ(exposed({10, 12, 11, 13}), 4); }

}  // namespace
}  // namespace v3d
