#include "base/core/time.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicInstant kSteady = from_ns<Monotonic>(1'000'000'000'000);
constexpr RealtimeInstant kWall = from_ns<Realtime>(1'700'000'000'000'000'000);

TEST(RealtimeFollower, follows_a_slewed_clock) {
  RealtimeFollower follower;
  for (int i = 0; i < 1000; ++i) {
    const Duration slewed = i * 40ms;
    EXPECT_EQ(follower.follow(kSteady + i * 1s, kWall + i * 1s + slewed), kWall + i * 1s + slewed);
  }
  EXPECT_EQ(follower.step(kSteady + 1000s, kWall + 1000s + 999 * 40ms), 0ms);
}

TEST(RealtimeFollower, ignores_a_step_of_the_clock_until_it_is_adopted) {
  for (const Duration set : std::initializer_list<Duration>{-1h, -60s, -51ms, 51ms, 60s}) {
    RealtimeFollower follower;
    follower.follow(kSteady, kWall);
    EXPECT_EQ(follower.follow(kSteady + 5s, kWall + 5s + set), kWall + 5s);
    EXPECT_EQ(follower.step(kSteady + 5s, kWall + 5s + set), set);
    follower.adopt(kSteady + 6s, kWall + 6s + set);
    EXPECT_EQ(follower.step(kSteady + 6s, kWall + 6s + set), 0ms);
    EXPECT_EQ(follower.follow(kSteady + 7s, kWall + 7s + set), kWall + 7s + set);
  }
}

TEST(RealtimeFollower, reports_no_step_after_a_pause_between_two_readings) {
  RealtimeFollower follower;
  follower.follow(kSteady, kWall);
  EXPECT_EQ(follower.follow(kSteady + 1s, kWall + 1s + 300ms), kWall + 1s) << "the thread slept";
  EXPECT_EQ(follower.follow(kSteady + 2s, kWall + 2s), kWall + 2s);
  EXPECT_EQ(follower.step(kSteady + 2s, kWall + 2s), 0ms);
}

}  // namespace
}  // namespace v3d
