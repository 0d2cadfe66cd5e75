#include "daemon/message_seal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

namespace v3d {
namespace {

using namespace std::chrono_literals;
using Verdict = NewsGate::Verdict;

constexpr RealtimeInstant kNow = from_ns<Realtime>(1'700'000'000'000'000'000);

TEST(Seal, says_for_a_while_that_something_was_rejected_and_why) {
  MessageSeal seal;
  seal.set_key(StudioKey::make());
  EXPECT_EQ(seal.trouble(Realtime::now()), "");
  seal.count_forged();
  EXPECT_EQ(seal.counts().forged, 1);
  EXPECT_THAT(seal.trouble(Realtime::now()), testing::HasSubstr("another studio key"));
  seal.count_stale(60s);
  EXPECT_THAT(seal.trouble(Realtime::now()), testing::HasSubstr("60.0 s ago"));
  EXPECT_EQ(seal.trouble(Realtime::now() + 60s), "");
}

TEST(Seal, is_required_with_a_key_and_where_somebody_insists) {
  MessageSeal seal;
  EXPECT_FALSE(seal.is_required());
  seal.insist();
  EXPECT_TRUE(seal.is_required());
  EXPECT_EQ(seal.mac(), nullptr);
  seal.set_key(StudioKey::make());
  EXPECT_NE(seal.mac(), nullptr);
}

TEST(News, is_what_was_sent_shortly_before_or_by_a_clock_a_little_ahead_and_not_heard_yet) {
  NewsGate gate;
  EXPECT_EQ(gate.judge("cap01", 3, kNow - 4s, kNow), Verdict::kNews);
  EXPECT_EQ(gate.judge("cap01", 3, kNow - 4s, kNow), Verdict::kHeard);
  EXPECT_EQ(gate.judge("cap02", 3, kNow - 4s, kNow), Verdict::kNews) << "another sender";
  EXPECT_EQ(gate.judge("cap01", 4, kNow - 4s, kNow), Verdict::kNews) << "in the same instant";
  EXPECT_EQ(gate.judge("cap01", 2, kNow - 4500ms, kNow), Verdict::kNews) << "overtaken";
  EXPECT_EQ(gate.judge("cap01", 5, kNow - 6s, kNow), Verdict::kStale);
  EXPECT_EQ(gate.judge("cap01", 5, kNow + 1s, kNow), Verdict::kNews);
  EXPECT_EQ(gate.judge("cap01", 6, kNow + 3s, kNow), Verdict::kStale);
}

TEST(News, of_long_ago_stays_stale_when_the_clock_is_set_back) {
  NewsGate gate;
  EXPECT_EQ(gate.judge("cap01", 1, kNow, kNow), Verdict::kNews);
  EXPECT_EQ(gate.judge("cap01", 2, kNow + 6s, kNow + 6s), Verdict::kNews);
  EXPECT_EQ(gate.judge("cap01", 1, kNow, kNow + 1s), Verdict::kStale);
}

/// However many there are, in whatever order they come, and whenever they are played again.
RC_GTEST_PROP(News, is_never_told_twice, ()) {
  NewsGate gate;
  std::set<std::pair<int64_t, int64_t>> believed;
  const int64_t rate = *rc::gen::element<int64_t>(1, 25, 1000, 5000);
  RealtimeInstant now = kNow;
  for (int64_t i = 0; i < 4000; ++i) {
    now = kNow + i * Duration(1'000'000'000 / rate);
    const int64_t seq = i % 3 == 2 ? *rc::gen::inRange<int64_t>(0, i) : i;
    const RealtimeInstant sent = kNow + seq * Duration(1'000'000'000 / rate);
    if (gate.judge("cap01", seq, sent, now) == Verdict::kNews) {
      RC_ASSERT(believed.emplace(seq, to_ns(sent)).second);
    } else {
      RC_ASSERT(i % 3 == 2 || believed.contains({seq, to_ns(sent)}));
    }
  }
}

}  // namespace
}  // namespace v3d
