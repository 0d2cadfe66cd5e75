#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "trigger/action_generator.h"

namespace v3d::trigger {
namespace {

using io::ActionStatus;
using std::chrono::milliseconds;

constexpr uint32_t kCam01 = 0x7f00000b;  // 127.0.0.11
constexpr uint32_t kCam02 = 0x7f00000c;
constexpr auto kDeadline = ActionAcknowledgements::kDeadline;

/// Commands and acknowledgements at times of the test's own, long ago.
class ActionAcknowledgementsTest : public testing::Test {
 protected:
  static MonotonicInstant at(int64_t pulse) {
    return MonotonicInstant(std::chrono::seconds(1)) + pulse * milliseconds(10);
  }
  void send(int64_t pulse) { book_.sent(pulse, static_cast<uint16_t>(pulse + 1), at(pulse)); }
  void answer(uint32_t camera, int64_t pulse, MonotonicInstant now,
              ActionStatus status = ActionStatus::kSuccess) {
    book_.received(camera, {.status = status, .request = static_cast<uint16_t>(pulse + 1)}, now);
  }
  std::vector<int64_t> sensed() {
    std::vector<int64_t> numbers;
    while (const auto pulse = book_.wait(MonotonicInstant{})) {
      EXPECT_EQ(pulse->at, at(pulse->number));
      EXPECT_TRUE(pulse->is_numbered);
      numbers.push_back(pulse->number);
    }
    return numbers;
  }
  ActionAcknowledgements book_{
      std::vector<ActionCamera>{{"cam01", "127.0.0.11"}, {"cam02", "127.0.0.12"}}};
};

TEST_F(ActionAcknowledgementsTest, senses_a_pulse_that_a_camera_acknowledges_with_its_exact_time) {
  for (int64_t pulse = 0; pulse < 3; ++pulse) {
    send(pulse);
    answer(kCam01, pulse, at(pulse) - milliseconds(5));
    answer(kCam02, pulse, at(pulse) - milliseconds(4));
  }
  EXPECT_EQ(sensed(), (std::vector<int64_t>{0, 1, 2}));
  EXPECT_EQ(book_.counts(), (AcknowledgementCounts{.acknowledged = 6}));
  EXPECT_EQ(book_.warning(), "");
}

TEST_F(ActionAcknowledgementsTest, count_a_lost_one_for_its_camera_and_sense_the_pulse_by_another) {
  for (int64_t pulse = 0; pulse < 2; ++pulse) {
    send(pulse);
    answer(kCam01, pulse, at(pulse));
  }
  EXPECT_EQ(sensed(), (std::vector<int64_t>{0, 1}));
  EXPECT_EQ(book_.counts(), (AcknowledgementCounts{.acknowledged = 2, .missing = 2}));
  EXPECT_EQ(book_.warning(), "2 acknowledgements of action commands missing: cam02");
}

TEST_F(ActionAcknowledgementsTest, leave_a_pulse_without_any_commanded_but_not_sensed) {
  for (const int64_t pulse : {0, 1, 2}) send(pulse);
  answer(kCam01, 0, at(0));
  answer(kCam02, 2, at(2));
  EXPECT_EQ(sensed(), (std::vector<int64_t>{0, 2}));
  EXPECT_EQ(book_.counts().missing, 4);
}

TEST_F(ActionAcknowledgementsTest, count_repeated_late_and_foreign_ones_apart) {
  send(0);
  answer(kCam01, 0, at(0));
  answer(kCam01, 0, at(0));
  answer(0x0a000001, 0, at(0));
  answer(kCam01, 7, at(0));
  answer(kCam02, 0, at(0) + kDeadline);
  EXPECT_EQ(sensed(), (std::vector<int64_t>{0}));
  EXPECT_EQ(book_.counts(),
            (AcknowledgementCounts{
                .acknowledged = 1, .missing = 1, .repeated = 1, .late = 2, .foreign = 1}));
}

TEST_F(ActionAcknowledgementsTest, name_the_status_with_which_a_camera_rejects_commands) {
  send(0);
  answer(kCam01, 0, at(0), ActionStatus::kNoReferenceTime);
  answer(kCam02, 0, at(0), ActionStatus::kLate);
  EXPECT_EQ(sensed(), std::vector<int64_t>());
  EXPECT_EQ(book_.counts(), (AcknowledgementCounts{.rejected = 2}));
  EXPECT_EQ(book_.warning(),
            "2 action commands rejected: cam01 (no PTP time), cam02 (command too late)");
}

TEST_F(ActionAcknowledgementsTest, count_missing_ones_also_when_no_one_reads_the_pulses) {
  send(0);
  book_.expire(at(0) + kDeadline);
  EXPECT_EQ(book_.counts().missing, 2);
  book_.reset();
  EXPECT_EQ(book_.counts(), AcknowledgementCounts{});
  EXPECT_EQ(book_.warning(), "");
}

TEST(ActionAcknowledgements, need_the_address_of_every_camera) {
  const std::vector<ActionCamera> cameras = {{"cam01", "V3D-SIM-01"}};
  EXPECT_EQ(test::message_of<InputError>([&] { const ActionAcknowledgements book(cameras); }),
            "action trigger: camera cam01: 'V3D-SIM-01' is not an IPv4 address");
}

}  // namespace
}  // namespace v3d::trigger
