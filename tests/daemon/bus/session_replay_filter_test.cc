#include "daemon/bus/session_replay_filter.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

constexpr ReceiverTime kNow{from_ns<Monotonic>(3'600'000'000'000),
                            from_ns<Realtime>(1'700'000'000'000'000'000)};

ReceiverTime later(Duration by) { return {kNow.monotonic + by, kNow.realtime + by}; }
SessionStamp stamp(uint32_t session, uint32_t sequence, Duration sent = {}) {
  return {.session = session, .sequence = sequence, .sent = kNow.realtime + sent};
}

RC_GTEST_PROP(SessionReplayFilter, accepts_a_number_once_also_when_numbers_wrap, ()) {
  SessionReplayFilter filter;
  std::set<uint32_t> accepted;
  uint32_t newest = *rc::gen::element<uint32_t>(0, 5000, 0xffffff00U, 0x7fffff00U);
  for (int i = 0; i < 500; ++i) {
    const uint32_t number = newest + static_cast<uint32_t>(*rc::gen::inRange(-40, 41));
    if (!filter.is_received(stamp(7, number))) {
      RC_ASSERT(accepted.insert(number).second);
      filter.note(stamp(7, number), kNow);
      if (static_cast<int32_t>(number - newest) > 0) newest = number;
    } else {
      RC_ASSERT(accepted.contains(number));
    }
  }
}

wire::KeyId key_id(uint8_t first) { return {first}; }

TEST(SessionReplayFilter, keeps_responses_of_different_keys_apart) {
  SessionReplayFilter filter;
  filter.accept(stamp(7, 100), kNow, 0s, key_id(1));
  EXPECT_TRUE(filter.has_responded(7, key_id(1)));
  EXPECT_FALSE(filter.has_responded(7, key_id(2)));
  EXPECT_FALSE(filter.has_responded(7)) << "unknown key";
  filter.accept(stamp(7, 200), kNow, 0s, key_id(2));
  EXPECT_TRUE(filter.has_responded(7, key_id(2)));
  EXPECT_TRUE(filter.has_responded(7, key_id(1)));
  EXPECT_FALSE(filter.is_received(stamp(7, 201)));
}

TEST(SessionReplayFilter, keeps_numbers_and_times_of_different_keys_apart) {
  SessionReplayFilter filter;
  filter.note(stamp(7, 100), kNow, key_id(1));
  filter.note(stamp(7, 1'000'000, 1s), kNow, key_id(2));
  filter.accept(stamp(7, 2'000'000, 1h), kNow, 0s, key_id(2));
  EXPECT_FALSE(filter.is_received(stamp(7, 101), key_id(1)));
  EXPECT_TRUE(filter.is_received(stamp(7, 101), key_id(2)));
  EXPECT_TRUE(filter.is_recent(stamp(7, 101), kNow, key_id(1)));
  EXPECT_FALSE(filter.is_recent(stamp(7, 101), kNow, key_id(2)));
  for (const Duration sent : {Duration(0s), Duration(1h)}) {
    EXPECT_TRUE(filter.is_recent_for_any(stamp(7, 101, sent), kNow));
  }
  EXPECT_FALSE(filter.is_recent_for_any(stamp(7, 101, -1h), kNow));
}

TEST(SessionChallenges, accept_a_response_of_the_named_key_or_of_any_key_when_none_was_named) {
  SessionChallenges challenges;
  const int64_t nonce = challenges.issue(7, kNow.monotonic, key_id(1)).value();
  EXPECT_FALSE(challenges.pop_matching(7, nonce, kNow.monotonic, key_id(2)));
  EXPECT_FALSE(challenges.pop_matching(7, nonce, kNow.monotonic));
  EXPECT_TRUE(challenges.is_pending(7, nonce, kNow.monotonic, key_id(1)));
  EXPECT_TRUE(challenges.pop_matching(7, nonce, kNow.monotonic, key_id(1)));
  EXPECT_FALSE(challenges.pop_matching(7, nonce, kNow.monotonic, key_id(1))) << "once";
  const int64_t of_any = challenges.issue(7, kNow.monotonic).value();
  EXPECT_TRUE(challenges.pop_matching(7, of_any, kNow.monotonic, key_id(2)));
}

TEST(SessionReplayFilter, counts_messages_older_than_the_window_as_received) {
  SessionReplayFilter filter;
  filter.note(stamp(7, 5000), kNow);
  EXPECT_FALSE(filter.is_received(stamp(7, 5000 - SessionReplayFilter::kWindow + 1)));
  EXPECT_TRUE(filter.is_received(stamp(7, 5000 - SessionReplayFilter::kWindow)));
  EXPECT_FALSE(filter.is_received(stamp(8, 1))) << "another session";
}

TEST(SessionReplayFilter, rejects_old_messages_of_a_removed_session) {
  SessionReplayFilter filter;
  for (uint32_t i = 0; i <= SessionReplayFilter::kMaxSessions; ++i)
    filter.note(stamp(i, 1, i * 1ms), later(i * 1ms));
  EXPECT_FALSE(filter.is_recent(stamp(0, 1), later(1s))) << "session 0 was removed";
  EXPECT_TRUE(filter.is_received(stamp(1, 1, 1ms)));
  EXPECT_TRUE(filter.is_recent(stamp(999, 1, 1s), later(1s)));
  filter.accept(stamp(0, 5, 1s), later(1s), 0s);
  EXPECT_TRUE(filter.is_received(stamp(0, 1)));
  EXPECT_FALSE(filter.is_received(stamp(0, 6)));
}

TEST(SessionReplayFilter, accepts_an_unknown_session_whose_clock_agrees) {
  const SessionReplayFilter filter;
  EXPECT_TRUE(filter.is_recent(stamp(7, 1, -5s), kNow));
  EXPECT_FALSE(filter.is_recent(stamp(7, 1, -5s - 1us), kNow));
  EXPECT_TRUE(filter.is_recent(stamp(7, 1, 2s), kNow));
  EXPECT_FALSE(filter.is_recent(stamp(7, 1, 2s + 1us), kNow));
}

TEST(SessionReplayFilter, needs_no_wall_clock_for_a_known_session) {
  SessionReplayFilter filter;
  filter.note(stamp(7, 1), kNow);
  for (const Duration set : {-1h, 0h, 1h}) {
    const ReceiverTime now{kNow.monotonic + 60s, kNow.realtime + 60s + set};
    EXPECT_TRUE(filter.is_recent(stamp(7, 2, 59s), now)) << "the receiver's clock was set";
    EXPECT_FALSE(filter.is_recent(stamp(7, 2, 54s), now)) << "delayed by 6 s";
  }
}

TEST(SessionReplayFilter, gives_the_age_of_a_message_of_a_known_session) {
  SessionReplayFilter filter;
  EXPECT_EQ(filter.age(stamp(7, 1, -3s), kNow), 0s) << "unknown";
  filter.note(stamp(7, 1), kNow);
  const ReceiverTime now{kNow.monotonic + 10s, kNow.realtime - 1h};  // this PC's clock was set
  EXPECT_NEAR(to_seconds(filter.age(stamp(7, 2, 7s), now)), 3, 0.02);
  EXPECT_EQ(filter.age(stamp(7, 3, 11s), now), 0s) << "a clock that runs ahead";
}

Duration any_ms(int most) { return std::chrono::microseconds(*rc::gen::inRange(0, 1000 * most)); }

RC_GTEST_PROP(SessionReplayFilter,
              gives_the_time_of_sending_late_by_the_least_delay_whatever_the_wall_clocks_show, ()) {
  SessionReplayFilter filter;
  const Duration offset = std::chrono::milliseconds(*rc::gen::inRange(-7'200'000, 7'200'000));
  const Duration least = any_ms(20);
  filter.accept(stamp(7, 1, offset), later(least), least);
  const Duration sent = any_ms(10'000), delay = least + any_ms(4000);
  const ReceiverTime now{kNow.monotonic + sent + delay, kNow.realtime + any_ms(10'000)};
  RC_ASSERT(filter.sent_here(stamp(7, 2, offset + sent), now) == kNow.monotonic + sent + least);
}

TEST(SessionReplayFilter, gives_no_time_of_sending_after_the_reception) {
  SessionReplayFilter filter;
  EXPECT_EQ(filter.sent_here(stamp(7, 1, -3s), kNow), kNow.monotonic) << "unknown";
  filter.note(stamp(7, 1), later(5ms));
  EXPECT_EQ(filter.sent_here(stamp(7, 2, 1s), later(1002ms)), kNow.monotonic + 1002ms)
      << "this message was faster";
}

TEST(SessionReplayFilter, accepts_a_clock_that_drifts_for_a_day) {
  SessionReplayFilter filter;
  constexpr double kRate = 1 - 150e-6;  // two crystals, each at its limit
  for (int i = 0; i <= 24 * 60; ++i) {
    const Duration passed = i * 60s;
    const SessionStamp message =
        stamp(7, static_cast<uint32_t>(i), from_seconds(kRate * to_seconds(passed)));
    ASSERT_TRUE(filter.is_recent(message, later(passed))) << "minute " << i;
    filter.note(message, later(passed));
  }
}

TEST(SessionReplayFilter, rejects_a_session_whose_clock_was_set_until_it_responds) {
  SessionReplayFilter filter;
  filter.note(stamp(7, 1), kNow);
  EXPECT_FALSE(filter.is_recent(stamp(7, 2, -1h), later(1s)));
  filter.accept(stamp(7, 2, -1h), later(1s), 0s);
  EXPECT_TRUE(filter.is_recent(stamp(7, 3, -1h + 100ms), later(1100ms)));
  EXPECT_TRUE(filter.is_received(stamp(7, 1))) << "received messages stay received";
  EXPECT_FALSE(filter.is_recent(stamp(7, 4, -2h), later(2s)));
}

TEST(SessionReplayFilter,
     restarts_the_clock_comparison_only_if_a_response_seems_older_than_its_challenge) {
  // Age of a message that is 400 ms late.
  const auto age_after = [](Duration set_back, Duration late_response) {
    SessionReplayFilter filter;
    filter.accept(stamp(7, 1), kNow, 0s);
    filter.accept(stamp(7, 2, 1s - set_back), later(1s + late_response), late_response);
    return to_seconds(filter.age(stamp(7, 3, 2s - set_back), later(2400ms)));
  };
  constexpr double kDriftError = 0.003;
  EXPECT_NEAR(age_after(0s, 0s), 0.4, kDriftError);
  EXPECT_NEAR(age_after(0s, 300ms), 0.4, kDriftError) << "the late response changes nothing";
  EXPECT_NEAR(age_after(60ms, 1ms), 0.4, kDriftError);
  EXPECT_NEAR(age_after(3s, 1ms), 0.4, kDriftError);
  EXPECT_NEAR(age_after(-3s, 1ms), 0.4, kDriftError) << "set forward";
  EXPECT_NEAR(age_after(3s, 300ms), 0.1, kDriftError) << "the least possible age";
}

TEST(SessionReplayFilter, rejects_older_messages_after_the_first_response_of_a_session) {
  SessionReplayFilter filter;
  filter.note(stamp(7, 9), kNow);
  EXPECT_FALSE(filter.has_responded(7));
  EXPECT_FALSE(filter.is_received(stamp(7, 8)));
  filter.accept(stamp(7, 12), kNow, 0s);
  EXPECT_TRUE(filter.has_responded(7));
  for (const uint32_t old : {8U, 9U, 12U}) EXPECT_TRUE(filter.is_received(stamp(7, old))) << old;
  EXPECT_FALSE(filter.is_received(stamp(7, 13)));
}

TEST(SessionReplayFilter, keeps_received_messages_when_the_first_response_is_late) {
  SessionReplayFilter filter;
  filter.note(stamp(7, 9), kNow);
  filter.accept(stamp(7, 5), kNow, 0s);
  EXPECT_TRUE(filter.is_received(stamp(7, 9)));
  EXPECT_FALSE(filter.is_received(stamp(7, 10)));
}

TEST(SessionReplayFilter, removes_the_response_together_with_its_session) {
  SessionReplayFilter filter;
  filter.accept(stamp(7, 1), kNow, 0s);
  for (uint32_t i = 0; i < SessionReplayFilter::kMaxSessions; ++i) {
    EXPECT_EQ(filter.forgotten(), 0);
    filter.note(stamp(1000 + i, 1), later(1s));
  }
  EXPECT_EQ(filter.forgotten(), 1);
  EXPECT_FALSE(filter.has_responded(7));
}

TEST(SessionChallenges, accept_one_response_with_the_right_nonce_in_time) {
  SessionChallenges challenges;
  const auto now = kNow.monotonic;
  const auto nonce = challenges.issue(7, now);
  ASSERT_TRUE(nonce);
  EXPECT_FALSE(challenges.issue(7, now + 100ms)) << "sent 100 ms ago";
  EXPECT_EQ(challenges.issue(7, now + 200ms), nonce);
  EXPECT_FALSE(challenges.pop_matching(7, *nonce + 1, now + 300ms));
  EXPECT_FALSE(challenges.pop_matching(8, *nonce, now + 300ms));
  EXPECT_TRUE(challenges.pop_matching(7, *nonce, now + 300ms));
  EXPECT_FALSE(challenges.pop_matching(7, *nonce, now + 300ms)) << "repeated response";
  const auto late = challenges.issue(7, now + 1s);
  ASSERT_TRUE(late);
  EXPECT_NE(late, nonce);
  EXPECT_FALSE(challenges.pop_matching(7, *late, now + 1s + SessionChallenges::kResponseTimeout));
}

TEST(SessionChallenges, keep_16_challenges_pending) {
  SessionChallenges challenges;
  std::vector<int64_t> nonces;
  for (uint32_t session = 1; session <= 17; ++session) {
    nonces.push_back(*challenges.issue(session, kNow.monotonic + session * 1ms));
  }
  EXPECT_FALSE(challenges.pop_matching(1, nonces[0], kNow.monotonic + 50ms))
      << "the oldest challenge was replaced";
  for (uint32_t session = 2; session <= 17; ++session) {
    EXPECT_TRUE(challenges.pop_matching(session, nonces[session - 1], kNow.monotonic + 50ms));
  }
}

}  // namespace
}  // namespace v3d::bus
