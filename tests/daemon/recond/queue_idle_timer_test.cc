#include "daemon/recond/queue_idle_timer.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

using std::chrono::milliseconds;

TEST(QueueIdleTimer, is_what_its_reader_found_and_no_clock) {
  QueueIdleTimer quiet;
  EXPECT_FALSE(quiet.lasted(Duration::zero())) << "nobody has looked yet";
  const MonotonicInstant begin = Monotonic::now();
  quiet.took_one(begin);
  EXPECT_FALSE(quiet.lasted(Duration::zero())) << "more may wait behind it";
  quiet.found_none(begin + milliseconds(20));
  EXPECT_TRUE(quiet.lasted(milliseconds(20)));
  EXPECT_FALSE(quiet.lasted(milliseconds(21))) << "until the reader looks again";
  quiet.found_none(begin + milliseconds(40));
  EXPECT_TRUE(quiet.lasted(milliseconds(21)));
}

TEST(QueueIdleTimer, ends_with_the_next_message) {
  QueueIdleTimer quiet;
  const MonotonicInstant begin = Monotonic::now();
  quiet.found_none(begin + milliseconds(500));
  EXPECT_TRUE(quiet.lasted(milliseconds(400)));
  quiet.took_one(begin + milliseconds(510));
  EXPECT_FALSE(quiet.lasted(Duration::zero()));
  quiet.found_none(begin + milliseconds(530));
  EXPECT_FALSE(quiet.lasted(milliseconds(400)));
}

}  // namespace
}  // namespace v3d
