#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>

#include "daemon/bus/subscription_queue.h"

namespace v3d::bus {
namespace {

/// The time of sending of message `seq`: one message a millisecond.
RealtimeInstant sent(int64_t seq) { return from_ns<Realtime>(1'000'000 * (seq + 1)); }

void note(SequenceTracker& tracker, const std::string& key, std::vector<int64_t> numbers) {
  for (const int64_t seq : numbers) tracker.note(key, seq, sent(seq));
}

TEST(SequenceTracker, counts_messages_that_did_not_arrive_as_lost) {
  SequenceTracker tracker;
  note(tracker, "V3D_PULSE", {4, 5, 9});
  EXPECT_EQ(tracker.of("V3D_PULSE"), (SequenceCounts{.received = 3, .lost = 3}));
}

TEST(SequenceTracker, counts_losses_from_the_first_message_with_from_start) {
  SequenceTracker tracker(true);
  note(tracker, "a", {2, 3});
  EXPECT_EQ(tracker.of("a"), (SequenceCounts{.received = 2, .lost = 2}));
}

TEST(SequenceTracker, counts_no_message_as_lost_that_was_sent_before_a_new_count) {
  SequenceTracker tracker(true);
  tracker.start_new_count("joined in the middle");
  note(tracker, "joined in the middle", {7, 9});
  EXPECT_EQ(tracker.of("joined in the middle"), (SequenceCounts{.received = 2, .lost = 1}));
  note(tracker, "left and joined again", {0, 2});
  tracker.start_new_count("left and joined again");
  note(tracker, "left and joined again", {20, 21});
  EXPECT_EQ(tracker.of("left and joined again"), (SequenceCounts{.received = 4, .lost = 1}));
}

TEST(SequenceTracker, limits_the_losses_of_one_gap_to_a_million) {
  SequenceTracker tracker(true);
  tracker.note("a", INT64_MAX, sent(1));
  EXPECT_EQ(tracker.of("a"), (SequenceCounts{.received = 1, .lost = 1'000'000}));
}

TEST(SequenceTracker, counts_a_late_message_as_late_and_not_as_lost) {
  SequenceTracker tracker;
  note(tracker, "a", {0, 3, 1});
  EXPECT_EQ(tracker.of("a"), (SequenceCounts{.received = 3, .lost = 1, .late = 1}));
}

TEST(SequenceTracker, detects_a_restart_of_a_sender_whose_clock_was_set_back) {
  SequenceTracker tracker(true);
  note(tracker, "a", {0, 1, 2, 3});
  const RealtimeInstant hour_before = sent(0) - std::chrono::hours(1);
  for (const int64_t seq : {0, 1, 3}) tracker.note("a", seq, hour_before + Duration(seq));
  EXPECT_EQ(tracker.of("a"), (SequenceCounts{.received = 7, .lost = 1}));
}

TEST(SequenceTracker, counts_a_message_that_arrives_twice_once) {
  SequenceTracker tracker;
  note(tracker, "a", {0, 1, 1, 2, 0});
  EXPECT_EQ(tracker.of("a"), (SequenceCounts{.received = 3, .duplicate = 2}));
}

TEST(SequenceTracker, counts_each_channel_separately) {
  SequenceTracker tracker;
  note(tracker, "a", {1});
  note(tracker, "b", {7});
  note(tracker, "a", {2});
  note(tracker, "b", {9});
  EXPECT_EQ(tracker.of("a").lost, 0);
  EXPECT_EQ(tracker.of("b").lost, 1);
  EXPECT_EQ(tracker.total(), (SequenceCounts{.received = 4, .lost = 1}));
}

TEST(SequenceTracker, detects_a_restart_by_a_lower_number_that_was_sent_later) {
  SequenceTracker tracker;
  tracker.note("a", 100, sent(100));
  tracker.note("a", 0, sent(101));
  tracker.note("a", 2, sent(102));
  EXPECT_EQ(tracker.of("a"), (SequenceCounts{.received = 3, .lost = 1}));
}

TEST(SequenceTracker, accepts_the_highest_number_and_limits_the_gap) {
  SequenceTracker tracker;
  tracker.note("a", 0, sent(0));
  tracker.note("a", INT64_MAX, sent(1));
  EXPECT_LE(tracker.of("a").lost, 1'000'000);
  tracker.note("a", INT64_MAX, sent(1));
  EXPECT_EQ(tracker.of("a").duplicate, 1);
}

/// A network that loses, duplicates and reorders messages.
RC_GTEST_PROP(SequenceTracker, counts_lost_and_duplicate_messages_exactly, ()) {
  std::mt19937 random(*rc::gen::arbitrary<uint32_t>());
  const int messages = *rc::gen::inRange(1, 300);
  std::vector<std::pair<int, int64_t>> arriving;  // time, number
  int lost = 0;
  int repeated = 0;
  for (int seq = 0; seq < messages; ++seq) {
    const bool last = seq == messages - 1;  // losses after the newest message cannot be detected
    if (random() % 10 == 0 && !last) {
      ++lost;
      continue;
    }
    const int delay = last ? 1000 : static_cast<int>(random() % 20);
    arriving.emplace_back(seq + delay, seq);
    if (random() % 10 != 0) continue;
    ++repeated;
    arriving.emplace_back(seq + delay + static_cast<int>(random() % 20), seq);
  }
  std::stable_sort(arriving.begin(), arriving.end());
  SequenceTracker tracker(true);
  for (const auto& [when, seq] : arriving) tracker.note("a", seq, sent(seq));
  const SequenceCounts counts = tracker.of("a");
  RC_ASSERT(counts.lost == lost);
  RC_ASSERT(counts.duplicate == repeated);
  RC_ASSERT(counts.received == messages - lost);
}

/// Senders and receivers restart, clocks are set, sequence numbers arrive in any order.
RC_GTEST_PROP(SequenceTracker, never_counts_a_negative_number_of_lost_messages, (bool from_start)) {
  std::mt19937 random(*rc::gen::arbitrary<uint32_t>());
  SequenceTracker tracker(from_start);
  for (int n = 0; n < 300; ++n) {
    const std::string key(1, static_cast<char>('a' + random() % 2));
    if (random() % 20 == 0) tracker.start_new_count(key);
    tracker.note(key, random() % 30, sent(static_cast<int64_t>(random() % 40)));
    RC_ASSERT(tracker.of(key).lost >= 0);
  }
  SequenceCounts sum = tracker.of("a");
  sum += tracker.of("b");
  RC_ASSERT(sum == tracker.total());
  RC_ASSERT(sum.received + sum.duplicate == 300);
}

}  // namespace
}  // namespace v3d::bus
