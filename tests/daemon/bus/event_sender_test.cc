#include "daemon/bus/event_sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/child_process.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

TEST(EventSender, limits_events_of_a_growing_count_and_sends_another_problem_at_once) {
  Bus bus("udpm://239.255.76.67:7667?ttl=0");
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 64);
  EventSender sender(bus, "cap01");
  const MonotonicInstant now = Monotonic::now();
  const auto report = [&](const std::string& text, Duration after) {
    sender.report_condition(wire::Severity::kAlarm, "disk", text, "Look", now + after);
  };
  for (int n = 1000; n <= 1030; ++n) {
    report(std::to_string(n).insert(1, ",") + " frames lost: /takes is too slow", n * 1s);
  }
  report("2,000 frames lost: /takes is too slow", 1031s);
  report("2,001 frames lost: /takes is too slow", 1092s);
  report("the folder of the take is gone", 1093s);
  report("", 1094s);
  report("", 1095s);
  std::vector<std::string> texts;
  while (texts.size() < 5) {
    const auto event = events.wait(test::within(10));
    ASSERT_TRUE(event) << testing::PrintToString(texts);
    texts.push_back(event->text);
  }
  EXPECT_THAT(
      texts, testing::ElementsAre("1,000 frames lost: /takes is too slow. Look",
                                  "2,000 frames lost: /takes is too slow. Look",
                                  "2,001 frames lost: /takes is too slow. Look",
                                  "the folder of the take is gone. Look", "the problem has ended"));
}

TEST(EventSender, reports_a_count_that_has_grown_a_little_and_then_stays_after_a_minute) {
  Bus bus("udpm://239.255.76.67:7667?ttl=0");
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 64);
  EventSender sender(bus, "cap01");
  const MonotonicInstant now = Monotonic::now();
  const auto report = [&](const std::string& text, Duration after) {
    sender.report_condition(wire::Severity::kAlarm, "disk", text, "", now + after);
  };
  report("/data2: 1,000 frames lost", 0s);
  for (int seconds = 1; seconds < 60; ++seconds) report("/data2: 1,500 frames lost", seconds * 1s);
  report("/data2: 1,500 frames lost", 62s);
  report("/data2: 1,500 frames lost", 200s);
  report("", 201s);
  std::vector<std::string> texts;
  while (texts.empty() || texts.back() != "the problem has ended") {
    const auto event = events.wait(test::within(10));
    ASSERT_TRUE(event) << testing::PrintToString(texts);
    texts.push_back(event->text);
  }
  EXPECT_THAT(texts, testing::ElementsAre("/data2: 1,000 frames lost", "/data2: 1,500 frames lost",
                                          "the problem has ended"));
}

TEST(EventSender, shortens_a_text_that_receivers_would_drop) {
  Bus bus("udpm://239.255.76.67:7667?ttl=0");
  Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 64);
  EventSender(bus, "cap01")
      .send(wire::Severity::kAlarm, "disk", std::string(100'000, 'x'), "Look at the disk");
  const auto event = events.wait(test::within(10));
  ASSERT_TRUE(event);
  EXPECT_THAT(event->text, testing::EndsWith("xx .... Look at the disk"));
}

}  // namespace
}  // namespace v3d::bus
