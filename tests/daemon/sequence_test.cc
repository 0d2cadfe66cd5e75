#include "daemon/sequence.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

TEST(SequenceTracker, counts_what_was_sent_and_did_not_arrive) {
  SequenceTracker tracker;
  EXPECT_EQ(tracker.missed_before("V3D_PULSE", 4), 0);
  EXPECT_EQ(tracker.missed_before("V3D_PULSE", 5), 0);
  EXPECT_EQ(tracker.missed_before("V3D_PULSE", 9), 3);
}

TEST(SequenceTracker, keeps_channels_apart) {
  SequenceTracker tracker;
  tracker.missed_before("a", 1);
  tracker.missed_before("b", 7);
  EXPECT_EQ(tracker.missed_before("a", 2), 0);
  EXPECT_EQ(tracker.missed_before("b", 9), 1);
}

TEST(SequenceTracker, takes_a_lower_number_for_a_sender_that_started_again) {
  SequenceTracker tracker;
  tracker.missed_before("a", 100);
  EXPECT_EQ(tracker.missed_before("a", 0), 0);
  EXPECT_EQ(tracker.missed_before("a", 2), 1);
}

TEST(SequenceTracker, survives_the_highest_number_and_believes_no_absurd_gap) {
  SequenceTracker tracker;
  tracker.missed_before("a", 0);
  EXPECT_LE(tracker.missed_before("a", INT64_MAX), 1'000'000);
  EXPECT_EQ(tracker.missed_before("a", INT64_MAX), 0);
}

}  // namespace
}  // namespace v3d
