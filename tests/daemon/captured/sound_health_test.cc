#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/captured/node_sound.h"
#include "support/child_process.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

using sound::LevelFault;
using testing::ElementsAre;

class SoundHealth : public testing::Test {
 protected:
  wire::HealthMessage report(const NodeSound::Status& status) {
    wire::HealthMessage health;
    report_sound(status, health, sender_);
    return health;
  }
  /// The next events, as "subject: text".
  std::vector<std::string> next_events(size_t count) {
    std::vector<std::string> texts;
    while (texts.size() < count) {
      const auto event = events_.wait(test::within(10));
      if (!event) break;
      texts.push_back(event->subject + ": " + event->text);
    }
    return texts;
  }
  static NodeSound::Status open(std::vector<sound::ChannelFault> faults) {
    return {
        .is_open = true, .fault = {}, .peaks = {1, 0.1, 0, 0.5}, .level_faults = std::move(faults)};
  }

  bus::Bus bus_{"udpm://239.255.76.67:7667?ttl=0"};
  bus::Subscription<wire::EventMessage> events_{bus_, wire::kEventChannel, 64};
  bus::EventSender sender_{bus_, "cap01"};
};

TEST_F(SoundHealth, sends_an_event_for_each_channel_that_clips_or_is_silent) {
  const auto health = report(open({{1, LevelFault::kClips}, {3, LevelFault::kSilent}}));
  EXPECT_EQ(health.values.at("sound_channels_clipping"), 1);
  EXPECT_EQ(health.values.at("sound_channels_silent"), 1);
  EXPECT_EQ(health.values.at("sound_peak_1_db"), 0);
  EXPECT_EQ(health.values.at("sound_peak_2_db"), -20);
  EXPECT_THAT(
      next_events(2),
      ElementsAre("sound channel 1: clips, with peaks of -0.1 dBFS or more. Reduce the gain "
                  "of this channel",
                  "sound channel 3: is silent: no peak of -80 dBFS for 5 s. Check its "
                  "microphone, cable, power and gain; no action is needed where nothing is "
                  "connected"));
}

TEST_F(SoundHealth, sends_an_event_when_another_channel_becomes_silent) {
  report(open({{3, LevelFault::kSilent}}));
  report(open({{3, LevelFault::kSilent}}));
  report(open({{3, LevelFault::kSilent}, {4, LevelFault::kSilent}}));
  report(open({{4, LevelFault::kSilent}}));
  const auto events = next_events(3);
  ASSERT_EQ(events.size(), 3U);
  EXPECT_TRUE(events[0].starts_with("sound channel 3: is silent")) << events[0];
  EXPECT_TRUE(events[1].starts_with("sound channel 4: is silent")) << events[1];
  EXPECT_EQ(events[2], "sound channel 3: the problem has ended");
}

TEST_F(SoundHealth, sends_an_event_when_more_than_a_second_waits_for_the_disk) {
  NodeSound::Status status = open({});
  status.waiting_s = 0.9;
  report(status);
  status.waiting_s = 3.1;
  report(status);
  status.waiting_s = 0;
  report(status);
  EXPECT_THAT(
      next_events(2),
      ElementsAre(testing::StartsWith("sound disk: 3 s of sound wait for the disk. It is lost"),
                  "sound disk: the problem has ended"));
}

TEST_F(SoundHealth, sends_an_event_when_the_timecode_jumps) {
  NodeSound::Status status = open({});
  EXPECT_EQ(report(status).values.at("sound_timecode_jumps"), 0);
  status.take.timecode_jumps = 1;
  status.take.first_jump = "20:00:00:00 instead of 10:00:04:13";
  EXPECT_EQ(report(status).values.at("sound_timecode_jumps"), 1);
  EXPECT_THAT(next_events(1),
              ElementsAre(testing::StartsWith("sound timecode: 1 jump of the timecode: 20:00:00:00 "
                                              "instead of 10:00:04:13. The take continues")));
}

}  // namespace
}  // namespace v3d::captured
