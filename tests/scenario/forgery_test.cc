// Scenario tests of forged messages (commands, health, pulses, frames, events), sent by a process
// without the studio key and by a node that an attacker controls.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <mutex>
#include <random>

#include "daemon/bus/bus.h"
#include "studio4.h"
#include "support/raw_datagrams.h"
#include "take/ledger/verify.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;

/// An attacker without the studio key: records datagrams, replays them, and sends forged messages.
class Attacker {
 public:
  explicit Attacker(const std::string& url) : raw_(url), bus_(url), other_key_(url) {
    other_key_.authenticator().set_key(wire::StudioKey::make());
  }
  size_t record(size_t count) {
    const auto more = raw_.receive_all(count, std::chrono::seconds(5));
    recorded_.insert(recorded_.end(), more.begin(), more.end());
    return recorded_.size();
  }
  /// Sends a message without a MAC, or with the MAC of another key.
  void send(const std::string& channel, const wire::Bytes& bytes, bool with_other_key) {
    (with_other_key ? other_key_ : bus_).publish_authenticated(channel, bytes);
  }
  /// Sends each recorded datagram again, and once more with a changed bit.
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
  bus::Bus bus_;
  bus::Bus other_key_;
};

/// At 5 Hz and live quality, a busy machine records whole takes and reconstructs them.
class ForgedStudio : public Studio4 {
 protected:
  explicit ForgedStudio(bool has_members = false)
      : Studio4({.more = "quality = \"live\"\n",
                 .rate = "5",
                 .has_members = has_members,
                 .two_nodes = true}) {}

  static constexpr int kFramesAfterAttack = 40;
  using Send = std::function<void(const std::string& channel, const wire::Bytes& bytes)>;
  /// Fills in time and sequence number as a node of the studio does, and sends the message.
  template <class M>
  static void forge(const Send& send, const std::string& channel, M message, int64_t seq) {
    message.sent = Realtime::now();
    message.seq = seq;
    send(channel, encode(message));
  }
  void forge_messages(const Send& send, int64_t seq) const {
    wire::HealthMessage idle;
    idle.node = "cap01";
    forge(send, wire::health_channel("cap01"), idle, seq);
    wire::PulseMessage pulse;
    pulse.take = take_name_;
    pulse.pulse = 9000 + seq;
    forge(send, wire::kPulseChannel, pulse, seq);
    wire::EventMessage event;
    event.node = "cap01";
    event.severity = wire::Severity::kAlarm;
    event.text = "forged";
    forge(send, wire::kEventChannel, event, seq);
  }
  /// Messages that cap02 may send, and a frame of cam01.
  void forge_more(const Send& send, int64_t seq) const {
    wire::HealthMessage full;
    full.node = "cap02";
    full.state = wire::NodeState::kRecording;
    full.take = take_name_;
    full.values["disk_full_flag"] = 1;
    forge(send, wire::health_channel("cap02"), full, seq);
    forge_frame(send, seq);
  }
  void forge_frame(const Send& send, int64_t seq) const {
    wire::FrameMessage frame;
    frame.take = take_name_;
    frame.frame.camera = "cam01";
    frame.frame.label.pulse = 9000 + seq;
    frame.frame.sensor_size = {320, 240};
    frame.frame.mask = Mask({320, 240});
    frame.frame.image = Image({0, 0}, PixelFormat::kBayerRG8);
    forge(send, wire::frame_channel("cam01"), frame, seq);
  }
  /// Checks that all nodes still record, that the reconstruction uses the frames, and that both
  /// takes are complete after stop.
  void expect_a_complete_take() {
    record_to_the_end();
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    EXPECT_TRUE(stopped.done()) << text_of(stopped) << log();
    for (const auto& folder : {take().folder, folder_ / "cap02" / take_name_}) {
      const take::Verification verified = take::verify_take({folder});
      EXPECT_TRUE(verified.whole()) << verified.ledger.verdict();
    }
  }
  void record_to_the_end() {
    const double late = value("recon01", "frames_late");
    ASSERT_TRUE(
        reaches("cap02", "frames_written", value("cap02", "frames_written") + kFramesAfterAttack))
        << log();
    while (const auto event = client_->next_event(Monotonic::now())) {
      EXPECT_NE(event->text, "forged");
    }
    // A busy machine may be late with a few frames. After an accepted frame of a later pulse, all
    // frames are late, twice as many as those of cap02.
    EXPECT_LT(value("recon01", "frames_late") - late, kFramesAfterAttack);
    const auto all_health = client_->health(within(5));
    EXPECT_EQ(all_health.size(), 3U);
    for (const auto& [node, health] : all_health) {
      EXPECT_EQ(health.state, wire::NodeState::kRecording) << node << ": " << health.text;
    }
  }
};

TEST_F(ForgedStudio, rejects_forged_changed_and_replayed_messages_of_a_process_without_the_key) {
  constexpr int64_t kForged = 400;
  Attacker attacker(studio_.network.lcm_url);
  ASSERT_GE(attacker.record(6), 6U) << "health from before the take, in which no node records";
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 10)) << log();
  std::mt19937 random(7);
  for (int64_t seq = 0; seq < kForged; ++seq) {
    const Send send = [&](const std::string& channel, const wire::Bytes& bytes) {
      attacker.send(channel, bytes, seq % 2 == 1);
    };
    forge_messages(send, seq);
    forge_more(send, seq);
    if (seq % 100 == 0) {
      attacker.record(100);
      attacker.replay(random);
    }
  }
  for (const char* node : {"cap02", "recon01"}) {
    EXPECT_TRUE(reaches(node, "messages_forged", kForged)) << log();
    EXPECT_TRUE(reaches(node, "messages_replayed", 3)) << log();
  }
  expect_a_complete_take();
}

/// A studio with a member list. An attacker controls cap02: it has the studio key and the signing
/// key of cap02.
class MemberStudioWithForger : public ForgedStudio {
 protected:
  MemberStudioWithForger() : ForgedStudio(true) {
    forger_.authenticator().set_key(wire::StudioKey::load(studio_.network.key));
    forger_.authenticator().members().require();
    forger_.authenticator().members().set_signing_key(cap02_);
    forger_.authenticator().members().set_members(
        std::make_shared<const wire::MemberList>(members_));
  }

  bus::Bus forger_{studio_.network.lcm_url, {}, bus::ChannelList(studio_)};
  /// The forger subscribes, so that its session responds to challenges.
  const bus::Bus::HandlerRegistration responder_ =
      forger_.subscribe(wire::kEventChannel, [](const bus::ReceivedMessage&) {});
};

TEST_F(MemberStudioWithForger, rejects_messages_that_one_node_sends_in_the_name_of_another) {
  constexpr int64_t kForged = 50;
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 10)) << log();
  const Send send = [&](const std::string& channel, const wire::Bytes& bytes) {
    forger_.publish_authenticated(channel, bytes);
  };
  int64_t seq = 0;
  for (; seq < kForged; ++seq) forge_messages(send, seq);
  for (const char* node : {"cap01", "cap02", "recon01"}) {
    const auto are_counted_and_reported = [&] {
      forge_messages(send, ++seq);
      wire::HealthMessage health = client_->health(within(5))[node];
      return health.values["messages_unsigned"] >= kForged / 2 &&
             health.text.find("of member cap02 is rejected: only cap01 may send it") !=
                 std::string::npos;
    };
    EXPECT_TRUE(becomes_true(are_counted_and_reported, within(60))) << node << log();
    EXPECT_EQ(value(node, "messages_forged"), 0) << node;
  }
  expect_a_complete_take();
}

/// The forger sends frames of cam01 with the studio key, and with a frame key that it announces in
/// the name of cap02, which it may. Neither is the key of cap01.
TEST_F(MemberStudioWithForger, uses_no_frame_that_one_node_sends_for_the_camera_of_another) {
  constexpr int64_t kForged = 50;
  arm_and_start(0);
  ASSERT_TRUE(reaches("recon01", "meshes", 5)) << log();
  const Send with_studio_key = [&](const std::string& channel, const wire::Bytes& bytes) {
    forger_.publish_authenticated(channel, bytes);
  };
  const Send with_own_frame_key = [&](const std::string& channel, const wire::Bytes& bytes) {
    forger_.publish_frame(0, channel, bytes);
  };
  int64_t seq = 0;
  const auto are_reported = [&](const Send& send, const std::string& line) {
    forger_.announce_frame_key("cap02");
    for (int i = 0; i < 10; ++i) forge_frame(send, ++seq);
    const wire::HealthMessage health = client_->health(within(5))["recon01"];
    return health.values.contains("messages_unsigned") &&
           health.values.at("messages_unsigned") >= kForged &&
           health.text.find(line) != std::string::npos;
  };
  const auto with_studio_key_are_reported = [&] {
    return are_reported(with_studio_key, "V3D_FRAME_cam01 with the MAC of the studio key");
  };
  EXPECT_TRUE(becomes_true(with_studio_key_are_reported, within(60))) << log();
  const auto with_own_frame_key_are_reported = [&] {
    return are_reported(with_own_frame_key, "V3D_FRAME_cam01 of member cap02 is rejected");
  };
  EXPECT_TRUE(becomes_true(with_own_frame_key_are_reported, within(60))) << log();
  EXPECT_TRUE(reaches("recon01", "meshes", value("recon01", "meshes") + 5)) << log();
  for (const char* node : {"cap01", "cap02", "recon01"}) {
    EXPECT_EQ(value(node, "messages_forged"), 0) << node;
  }
  expect_a_complete_take();
}

/// An attacker that receives and records every command. With the studio key, its datagrams pass the
/// check of their MAC.
class Eavesdropper {
 public:
  explicit Eavesdropper(const std::string& url, const wire::StudioKey* key = nullptr) : bus_(url) {
    if (key != nullptr) bus_.authenticator().set_key(*key);
    subscription_.emplace(
        bus_.subscribe(wire::kCommandChannel, [this](const bus::ReceivedMessage& message) {
          const std::lock_guard lock(mutex_);
          ++received_;
          if (recording_) recorded_.emplace_back(message.bytes.begin(), message.bytes.end());
        }));
  }
  /// Waits up to 30 s for `at_least` commands and returns them. Later commands are only counted.
  std::vector<wire::Bytes> recorded(size_t at_least) {
    EXPECT_TRUE(becomes_true([&] { return received() >= at_least; }, within(30)));
    const std::lock_guard lock(mutex_);
    recording_ = false;
    return recorded_;
  }
  /// Sends all messages of `batch`, at most as many as a socket buffer holds, and waits until they
  /// are received here.
  void send(const std::vector<wire::Bytes>& batch) {
    const size_t before = received();
    for (const wire::Bytes& bytes : batch) bus_.publish_command(bytes);
    ASSERT_TRUE(becomes_true([&] { return received() >= before + batch.size(); }, within(30)));
  }

 private:
  size_t received() {
    const std::lock_guard lock(mutex_);
    return received_;
  }
  std::mutex mutex_;
  size_t received_ = 0;
  bool recording_ = true;
  std::vector<wire::Bytes> recorded_;
  bus::Bus bus_;
  // Last: its thread uses the other members.
  std::optional<bus::Bus::HandlerRegistration> subscription_;
};

/// At 5 Hz, a busy machine records whole takes.
class CommandedStudio4 : public Studio4 {
 protected:
  CommandedStudio4() : Studio4({.rate = "5"}) {}
};

TEST_F(CommandedStudio4, rejects_thousands_of_forged_replayed_stale_and_changed_commands) {
  constexpr int kBatches = 50;
  constexpr int kEach = 20;
  const wire::StudioKey key = wire::StudioKey::load(studio_.network.key);
  Eavesdropper stranger(studio_.network.lcm_url), attacker(studio_.network.lcm_url, &key);
  arm_and_start(0);
  // Arm, commit, start for one node, start for the other node.
  const std::vector<wire::Bytes> recorded = attacker.recorded(4);
  ASSERT_GE(recorded.size(), 4U);
  wire::CommandMessage stop;
  stop.sender = "stranger";
  stop.verb = wire::CommandVerb::kStop;
  stop.to = {"cap01", "recon01"};
  std::mt19937 random(7);
  int sent = 0;
  const auto send_batch = [&] {
    std::vector<wire::Bytes> batch;
    for (int k = 0; k < kEach; ++k) {
      stop.counter = sent * kEach + k;
      stop.sent = Realtime::now();
      batch.push_back(encode_with_mac(stop, wire::StudioKey::make()));
      stop.sent -= std::chrono::hours(1);
      batch.push_back(encode_with_mac(stop, key));
      batch.push_back(recorded[random() % recorded.size()]);
      batch.push_back(recorded[random() % recorded.size()]);
      batch.back()[random() % batch.back().size()] ^= static_cast<uint8_t>(1 << random() % 8);
    }
    stranger.send(batch);
    attacker.send(batch);
    ++sent;
  };
  while (sent < kBatches) send_batch();
  const double of_each_kind = 0.9 * kBatches * kEach;
  for (const char* node : {"cap01", "recon01"}) {
    // The receive buffer of a busy node overflows, so the attack continues until all are counted.
    const auto are_counted = [&] {
      if (value(node, "messages_forged") >= 4 * of_each_kind &&
          value(node, "commands_forged") >= 2 * of_each_kind &&
          value(node, "commands_without_nonce") >= of_each_kind) {
        return true;
      }
      send_batch();
      client_->next_health(within(2));
      return false;
    };
    EXPECT_TRUE(becomes_true(are_counted, within(60))) << node << log();
    // Replayed commands whose nonce has expired meanwhile are counted above.
    EXPECT_TRUE(reaches(node, "commands_replayed", 1)) << log();
    EXPECT_EQ(client_->health(within(5)).at(node).state, wire::NodeState::kRecording);
  }
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict();
}

}  // namespace
}  // namespace v3d
