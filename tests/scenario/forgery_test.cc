// A stranger on the network who says what nodes act upon: that the pulses have ended, that a disk
// is full, which pulse it is, what a camera sees, that something is wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>
#include <nlohmann/json.hpp>
#include <random>

#include "daemon/bus.h"
#include "studio4.h"
#include "take/verify.h"
#include "wire/channels.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;

/// Hears all that is sent, as anybody can, and says what he likes.
class Stranger {
 public:
  struct Heard {
    std::string channel;
    Bytes bytes;
  };
  explicit Stranger(const std::string& url) : bus_(url) {
    listening_.emplace(bus_.subscribe(
        "V3D_.*", [this](const std::string& channel, std::span<const uint8_t> bytes) {
          const std::lock_guard lock(mutex_);
          if (heard_.size() < kMost) heard_.push_back({channel, {bytes.begin(), bytes.end()}});
        }));
  }
  std::vector<Heard> heard() {
    const std::lock_guard lock(mutex_);
    return heard_;
  }
  void say(const std::string& channel, const Bytes& bytes) { bus_.publish(channel, bytes); }

 private:
  static constexpr size_t kMost = 300;
  std::mutex mutex_;
  std::vector<Heard> heard_;
  Bus bus_;
  std::optional<Bus::Listening> listening_;  // last: it uses the rest
};

class ForgedStudio : public Studio4 {
 protected:
  ForgedStudio() : Studio4({.rate = "10", .two_nodes = true}) {
    other_key_.set_key(StudioKey::make());
  }

  /// As if a node of the studio had said it, but for the key.
  template <class M>
  void forge(Stranger& stranger, const std::string& channel, M message, int64_t seq) {
    message.sent = Realtime::now();
    message.seq = seq;
    stranger.say(channel, seq % 2 == 0 ? encode(message) : other_key_.closed(encode(message)));
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
  /// What was heard, again and with a bit changed.
  void replay_everything(Stranger& stranger, std::mt19937& random) {
    for (Stranger::Heard heard : stranger.heard()) {
      if (heard.channel == kCommandChannel || heard.channel == kReplyChannel) continue;
      stranger.say(heard.channel, heard.bytes);
      heard.bytes[random() % heard.bytes.size()] ^= static_cast<uint8_t>(1 << random() % 8);
      stranger.say(heard.channel, heard.bytes);
    }
  }
  MessageSeal other_key_;
};

TEST_F(ForgedStudio, acts_upon_nothing_that_a_stranger_says_changes_or_says_again) {
  constexpr int64_t kForged = 400;
  Stranger stranger(studio_.network.lcm_url);
  ASSERT_TRUE(becomes_true([&] { return stranger.heard().size() >= 6; }, within(30)))
      << "health of before the take, which says that nothing is recorded";
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 10)) << log();
  std::mt19937 random(7);
  for (int64_t seq = 0; seq < kForged; ++seq) {
    forge_everything(stranger, seq);
    if (seq % 100 == 0) replay_everything(stranger, random);
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
