// Scenario tests of two daemons with the same node name: they raise an alarm and reject a new take;
// a running take continues.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "studio4.h"
#include "take/ledger/verify.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::Studio4;
using test::within;

class DuplicateNodeName : public Studio4 {
 protected:
  void start_duplicate() {
    duplicate_.emplace(std::vector<std::string>{bin("v3d-captured"), "--studio",
                                                folder_ / "studio.toml", "--node", "cap01"},
                       folder_ / "duplicate.log");
  }
  /// Waits up to 60 s for the alarm in the health of cap01. False at timeout.
  bool raises_alarm() {
    return becomes_true(
        [&] {
          const auto health = client_->health(within(5));
          const auto cap01 = health.find("cap01");
          return cap01 != health.end() &&
                 cap01->second.text.find("another process sends as node cap01") !=
                     std::string::npos;
        },
        within(60));
  }
  bool duplicate_knows() const {
    return becomes_true(
        [&] {
          return duplicate_->output().find("another process sends as node cap01") !=
                 std::string::npos;
        },
        within(60));
  }
  std::optional<ChildProcess> duplicate_;
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
  arm_and_start(100);
  ASSERT_TRUE(becomes_true(
      [&] { return client_->health(within(5))["cap01"].state == wire::NodeState::kRecording; },
      within(60)))
      << log();
  start_duplicate();
  EXPECT_TRUE(raises_alarm()) << log() << duplicate_->output();
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

}  // namespace
}  // namespace v3d
