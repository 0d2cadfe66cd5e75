#include "daemon/bus/event_sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/child_process.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

class EventSenderTest : public testing::Test {
 protected:
  /// Reports the condition, at a time after the beginning of the test.
  void report(const std::string& text, Duration after) {
    sender_.report_condition(wire::Severity::kAlarm, "disk", text, "Look", begin_ + after);
  }

  /// The texts of the events, up to the end of the condition.
  std::vector<std::string> texts() {
    std::vector<std::string> texts;
    while (texts.empty() || texts.back() != "the problem has ended") {
      const auto event = events_.wait(test::within(10));
      if (!event) return texts;
      texts.push_back(event->text);
    }
    return texts;
  }

  Bus bus_{"udpm://239.255.76.67:7667?ttl=0"};
  Subscription<wire::EventMessage> events_{bus_, wire::kEventChannel, 64};
  EventSender sender_{bus_, "cap01"};
  const MonotonicInstant begin_ = Monotonic::now();
};

TEST_F(EventSenderTest, limits_events_of_a_growing_count_and_sends_another_problem_at_once) {
  for (int n = 1000; n <= 1030; ++n) {
    report(std::to_string(n).insert(1, ",") + " frames lost: /takes is too slow", n * 1s);
  }
  report("2,000 frames lost: /takes is too slow", 1031s);
  report("2,001 frames lost: /takes is too slow", 1092s);
  report("the folder of the take is gone", 1093s);
  report("", 1094s);
  report("", 1095s);
  EXPECT_THAT(texts(), testing::ElementsAre("1,000 frames lost: /takes is too slow. Look",
                                            "2,000 frames lost: /takes is too slow. Look",
                                            "2,001 frames lost: /takes is too slow. Look",
                                            "the folder of the take is gone. Look",
                                            "the problem has ended"));
}

TEST_F(EventSenderTest, reports_a_count_that_has_grown_a_little_and_then_stays_after_a_minute) {
  report("/data2: 1,000 frames lost", 0s);
  for (int seconds = 1; seconds < 60; ++seconds) report("/data2: 1,500 frames lost", seconds * 1s);
  report("/data2: 1,500 frames lost", 62s);
  report("/data2: 1,500 frames lost", 200s);
  report("", 201s);
  EXPECT_THAT(texts(),
              testing::ElementsAre("/data2: 1,000 frames lost. Look",
                                   "/data2: 1,500 frames lost. Look", "the problem has ended"));
}

TEST_F(EventSenderTest, shortens_a_text_that_receivers_would_drop) {
  sender_.send(wire::Severity::kAlarm, "disk", std::string(100'000, 'x'), "Look at the disk");
  const auto event = events_.wait(test::within(10));
  ASSERT_TRUE(event);
  EXPECT_THAT(event->text, testing::EndsWith("xx .... Look at the disk"));
}

}  // namespace
}  // namespace v3d::bus
