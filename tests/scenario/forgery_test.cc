// A stranger on the network who says what nodes act upon: that the pulses have ended, that a disk
// is full, which pulse it is, what a camera sees, that something is wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "daemon/bus/bus.h"
#include "studio4.h"
#include "support/raw_datagrams.h"
#include "take/ledger/verify.h"
#include "wire/channels.h"

namespace v3d {
namespace {

using test::Studio4;
using test::within;

/// Receives all datagrams, as anybody can, sends them again, and says what he likes.
class Stranger {
 public:
  explicit Stranger(const std::string& url) : raw_(url), bus_(url), other_key_(url) {
    other_key_.seal().set_key(StudioKey::make());
  }
  size_t record(size_t count) {
    const auto more = raw_.receive_all(count, std::chrono::seconds(5));
    recorded_.insert(recorded_.end(), more.begin(), more.end());
    return recorded_.size();
  }
  /// Without a MAC, or with that of another key.
  void say(const std::string& channel, const Bytes& bytes, bool with_other_key) {
    (with_other_key ? other_key_ : bus_).publish_sealed(channel, bytes);
  }
  /// What was recorded, again and with a bit changed.
  void replay(std::mt19937& random) const {
    for (test::RawDatagram datagram : recorded_) {
      raw_.send(datagram);
      datagram[random() % datagram.size()] ^= static_cast<uint8_t>(1 << random() % 8);
      raw_.send(datagram);
    }
  }

 private:
  const test::RawSocket raw_;
  std::vector<test::RawDatagram> recorded_;
  Bus bus_;
  Bus other_key_;
};

class ForgedStudio : public Studio4 {
 protected:
  ForgedStudio() : Studio4({.rate = "10", .two_nodes = true}) {}

  /// As if a node of the studio had said it, but for the key.
  template <class M>
  void forge(Stranger& stranger, const std::string& channel, M message, int64_t seq) {
    message.sent = Realtime::now();
    message.seq = seq;
    stranger.say(channel, encode(message), seq % 2 == 1);
  }
  void forge_everything(Stranger& stranger, int64_t seq) {
    HealthMessage idle;
    idle.node = "cap01";
    forge(stranger, health_channel("cap01"), idle, seq);
    HealthMessage full;
    full.node = "cap02";
    full.state = NodeState::kRecording;
    full.take = take_name_;
    full.values["disk_full_flag"] = 1;
    forge(stranger, health_channel("cap02"), full, seq);
    PulseMessage pulse;
    pulse.take = take_name_;
    pulse.pulse = 9000 + seq;
    forge(stranger, kPulseChannel, pulse, seq);
    FrameMessage frame;
    frame.take = take_name_;
    frame.frame.camera = "cam01";
    frame.frame.label.pulse = 9000 + seq;
    frame.frame.sensor_size = {320, 240};
    frame.frame.mask = Mask({320, 240});
    frame.frame.image = Image({0, 0}, PixelFormat::kBayerRG8);
    forge(stranger, frame_channel("cam01"), frame, seq);
    EventMessage event;
    event.node = "cap01";
    event.severity = Severity::kAlarm;
    event.text = "forged";
    forge(stranger, kEventChannel, event, seq);
  }
};

TEST_F(ForgedStudio, acts_upon_nothing_that_a_stranger_says_changes_or_says_again) {
  constexpr int64_t kForged = 400;
  Stranger stranger(studio_.network.lcm_url);
  ASSERT_GE(stranger.record(6), 6U)
      << "health of before the take, which says that nothing is recorded";
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 10)) << log();
  std::mt19937 random(7);
  for (int64_t seq = 0; seq < kForged; ++seq) {
    forge_everything(stranger, seq);
    if (seq % 100 == 0) {
      stranger.record(100);
      stranger.replay(random);
    }
  }
  for (const char* node : {"cap02", "recon01"}) {
    EXPECT_TRUE(reaches(node, "messages_forged", kForged)) << log();
    EXPECT_TRUE(reaches(node, "messages_replayed", 3)) << log();
  }
  ASSERT_TRUE(reaches("cap02", "frames_written", value("cap02", "frames_written") + 40)) << log();
  while (const auto event = client_->next_event(Monotonic::now())) EXPECT_NE(event->text, "forged");
  for (const auto& [node, health] : client_->health(within(5))) {
    EXPECT_EQ(health.state, NodeState::kRecording) << node << ": " << health.text;
  }
  const Answer stopped = command(CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  for (const auto& folder : {take().folder, folder_ / "cap02" / take_name_}) {
    const Verification verified = verify_take({folder});
    EXPECT_TRUE(verified.whole()) << verified.ledger.verdict();
  }
  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  EXPECT_EQ(recon["frames_late"], 0) << "as after a frame of a pulse to come";
}

}  // namespace
}  // namespace v3d
