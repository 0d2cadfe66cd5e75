#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "daemon/bus/channel_list.h"

namespace v3d::bus {
namespace {

TEST(FrameNumbers, increase_by_one_without_groups) {
  FrameNumbers numbers(1);
  for (const int64_t pulse : {0, 1, 5, 6}) {
    const int64_t before = numbers.next(pulse);
    EXPECT_EQ(numbers.next(pulse), before + 1);
  }
}

RC_GTEST_PROP(FrameNumbers, encode_the_group_and_leave_no_gap_in_it_for_any_set_of_pulses, ()) {
  const auto groups = *rc::gen::inRange<size_t>(1, 9);
  FrameNumbers numbers(groups);
  std::map<size_t, int64_t> sent;
  for (const auto pulse :
       *rc::gen::container<std::vector<int64_t>>(rc::gen::inRange<int64_t>(0, 1000))) {
    const int64_t number = numbers.next(pulse);
    const size_t group = FrameNumbers::group_of(pulse, groups);
    RC_ASSERT(number % static_cast<int64_t>(groups) == static_cast<int64_t>(group));
    RC_ASSERT(number / static_cast<int64_t>(groups) == sent[group]++);
  }
}

TEST(FrameNumbers, put_a_frame_without_a_pulse_into_group_0) {
  EXPECT_EQ(FrameNumbers::group_of(-1, 3), 0U);
}

}  // namespace
}  // namespace v3d::bus
