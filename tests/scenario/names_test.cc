// Scenario tests of two daemons with the same node name: they raise an alarm and reject a new take;
// a running take continues.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "studio4.h"
#include "take/ledger/verify.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;

class DuplicateNodeName : public Studio4 {
 protected:
  /// At 5 Hz, a busy machine records whole takes.
  explicit DuplicateNodeName(bool two_nodes = false)
      : Studio4({.rate = "5", .two_nodes = two_nodes}) {}
};

TEST_F(DuplicateNodeName, rejects_arming_until_one_process_has_ended) {
  start_duplicate();
  ASSERT_TRUE(raises_alarm()) << log() << duplicate_->output();
  const control::Answer rejected = command(wire::CommandVerb::kArm, 10);
  EXPECT_FALSE(rejected.done());
  EXPECT_THAT(text_of(rejected), testing::HasSubstr("another process sends as node cap01"));
  duplicate_.reset();
  EXPECT_TRUE(becomes_true([&] { return command(wire::CommandVerb::kArm, 10).done(); }, within(60)))
      << log();
}

TEST_F(DuplicateNodeName, does_not_damage_a_running_take) {
  arm_and_start(60);
  ASSERT_TRUE(becomes_true(
      [&] { return client_->health(within(5))["cap01"].state == wire::NodeState::kRecording; },
      within(60)))
      << log();
  start_duplicate();
  EXPECT_TRUE(raises_alarm()) << log() << duplicate_->output();
  EXPECT_EQ(client_->health(within(5))["recon01"].state, wire::NodeState::kRecording)
      << "the take ended before the second process was noticed";
  ASSERT_TRUE(becomes_true(
      [&] {
        const auto health = client_->health(within(5));
        return std::ranges::none_of(health, [](const auto& entry) {
          return entry.second.state == wire::NodeState::kRecording ||
                 entry.second.state == wire::NodeState::kDraining;
        });
      },
      within(60)))
      << log();
  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict() << log() << duplicate_->output();
}

TEST_F(DuplicateNodeName, is_stopped_by_the_process_that_records) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
  start_duplicate();
  ASSERT_TRUE(raises_alarm()) << log() << duplicate_->output();
  ASSERT_TRUE(duplicate_knows()) << duplicate_->output();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log() << duplicate_->output();
  EXPECT_THAT(stopped.replies.at("cap01").detail, testing::HasSubstr("\"complete\":true"));
  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict() << log() << duplicate_->output();
}

class DuplicateNodeOfTheTrigger : public DuplicateNodeName {
 protected:
  DuplicateNodeOfTheTrigger() : DuplicateNodeName(true) {}
};

TEST_F(DuplicateNodeOfTheTrigger, ends_no_running_take_of_another_node) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 20)) << log();
  start_duplicate();
  ASSERT_TRUE(raises_alarm()) << log() << duplicate_->output();
  ASSERT_TRUE(duplicate_knows()) << duplicate_->output();
  const double written = value("cap02", "frames_written");
  EXPECT_TRUE(reaches("cap02", "frames_written", written + 40)) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log() << duplicate_->output();
  for (const take::TakePaths& part : {take(), take_of_cap02()}) {
    const take::Verification verified = verify_take(part);
    EXPECT_TRUE(verified.whole()) << verified.ledger.verdict() << log() << duplicate_->output();
  }
}

}  // namespace
}  // namespace v3d
