#include "daemon/sequence_window.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

namespace v3d {
namespace {

using namespace std::chrono_literals;

constexpr RealtimeInstant kNow = from_ns<Realtime>(1'700'000'000'000'000'000);

RC_GTEST_PROP(SequenceWindows, accept_a_number_once_also_where_numbers_wrap, ()) {
  SequenceWindows windows;
  std::set<uint32_t> accepted;
  uint32_t newest = *rc::gen::element<uint32_t>(0, 5000, 0xffffff00U, 0x7fffff00U);
  for (int i = 0; i < 500; ++i) {
    const uint32_t number = newest + static_cast<uint32_t>(*rc::gen::inRange(-40, 41));
    if (!windows.is_received(7, number, kNow)) {
      RC_ASSERT(accepted.insert(number).second);
      windows.note(7, number, kNow);
      if (static_cast<int32_t>(number - newest) > 0) newest = number;
    } else {
      RC_ASSERT(accepted.contains(number));
    }
  }
}

TEST(SequenceWindows, count_what_is_older_than_the_window_as_received) {
  SequenceWindows windows;
  windows.note(7, 5000, kNow);
  EXPECT_FALSE(windows.is_received(7, 5000 - SequenceWindows::kWindow + 1, kNow));
  EXPECT_TRUE(windows.is_received(7, 5000 - SequenceWindows::kWindow, kNow));
  EXPECT_FALSE(windows.is_received(8, 1, kNow)) << "another session";
}

TEST(SequenceWindows, accept_nothing_again_of_a_session_that_they_forgot) {
  SequenceWindows windows;
  for (uint32_t i = 0; i <= SequenceWindows::kMaxSessions; ++i) windows.note(i, 1, kNow + i * 1ms);
  EXPECT_TRUE(windows.is_received(0, 1, kNow)) << "session 0 was forgotten";
  EXPECT_TRUE(windows.is_received(1, 1, kNow + 1ms));
  EXPECT_FALSE(windows.is_received(999, 1, kNow + 1s));
}

}  // namespace
}  // namespace v3d
