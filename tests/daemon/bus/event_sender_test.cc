#include "daemon/bus/event_sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/child_process.h"
#include "wire/channels.h"

namespace v3d {
namespace {

using namespace std::chrono_literals;

TEST(EventSender, tells_a_trouble_that_grows_calmly_and_another_one_at_once) {
  Bus bus("udpm://239.255.76.67:7667?ttl=0");
  Subscription<EventMessage> events(bus, kEventChannel, 64);
  EventSender sender(bus, "cap01");
  const MonotonicInstant now = Monotonic::now();
  const auto keep_told = [&](const std::string& text, Duration after) {
    sender.keep_told(Severity::kAlarm, "disk", text, "Look", now + after);
  };
  for (int n = 1000; n <= 1030; ++n) {
    keep_told(std::to_string(n).insert(1, ",") + " frames lost: /takes is too slow", n * 1s);
  }
  keep_told("2,000 frames lost: /takes is too slow", 1031s);
  keep_told("2,001 frames lost: /takes is too slow", 1092s);
  keep_told("the folder of the take is gone", 1093s);
  keep_told("", 1094s);
  keep_told("", 1095s);
  std::vector<std::string> told;
  while (told.size() < 5) {
    const auto event = events.wait(test::within(10));
    ASSERT_TRUE(event) << testing::PrintToString(told);
    told.push_back(event->text);
  }
  EXPECT_THAT(told, testing::ElementsAre("1,000 frames lost: /takes is too slow. Look",
                                         "2,000 frames lost: /takes is too slow. Look",
                                         "2,001 frames lost: /takes is too slow. Look",
                                         "the folder of the take is gone. Look", "well again"));
}

}  // namespace
}  // namespace v3d
