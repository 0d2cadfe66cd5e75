// Scenario tests of an attacker who knows LCM's wire format but has no studio key. Each of these
// attacks once worked: it ended processes, wrote into their memory, kept them busy or made them
// grow.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/bus/bus.h"
#include "studio4.h"
#include "support/process_meter.h"
#include "support/raw_datagrams.h"
#include "take/ledger/verify.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::fragment_header;
using test::put_text;
using test::RawDatagram;
using test::RawFragment;
using test::RawSocket;
using test::short_datagram;
using test::Studio4;
using test::within;

/// One channel of each kind that a daemon subscribes to.
const std::vector<std::string> kChannels = {"V3D_COMMAND",      "V3D_REPLY",       "V3D_PULSE",
                                            "V3D_HEALTH_cap01", "V3D_FRAME_cam01", "V3D_EVENT"};

constexpr uint32_t kRounds = 50;

RawDatagram first_fragment(const RawFragment& fragment, const std::string& channel, size_t data) {
  RawDatagram bytes = fragment_header(fragment);
  put_text(bytes, channel + '\0');
  bytes.resize(bytes.size() + data, 'x');
  return bytes;
}

/// Sends datagrams that end with the channel name, without a NUL. In a buffer that held zeros
/// before, liblcm 1.3.1 computes a data size of -1 bytes.
void send_channels_without_nul(const RawSocket& attacker) {
  for (uint32_t i = 0; i < kRounds; ++i) {
    RawDatagram zeros = short_datagram(i, std::string(wire::kCommandChannel) + '\0');
    zeros.resize(300 + 50 * i);
    attacker.send(zeros);
    for (const std::string& channel : kChannels) attacker.send(short_datagram(1, channel));
  }
}

/// Sends fragments whose offset and size add up to 0 in 32 bits.
void send_offsets_that_wrap(const RawSocket& attacker) {
  constexpr uint32_t kSize = 0x1000;
  for (uint32_t sequence = 0; sequence < kChannels.size(); ++sequence) {
    RawFragment fragment = {.sequence = sequence, .message_size = 2 * kSize, .count = 3};
    attacker.send(first_fragment(fragment, kChannels[sequence], 10));
    fragment.number = 1;
    fragment.offset = 0U - kSize;
    RawDatagram wrapping = fragment_header(fragment);
    wrapping.resize(wrapping.size() + kSize, 'y');
    attacker.send(wrapping);
  }
}

/// Sends datagrams of 50 bytes whose header claims a message of 256 MB in one fragment.
void send_large_claims(const RawSocket& attacker) {
  for (uint32_t sequence = 0; sequence < 64; ++sequence) {
    const RawFragment fragment = {.sequence = sequence, .message_size = 256U << 20, .count = 1};
    attacker.send(first_fragment(fragment, wire::kCommandChannel, 10));
  }
}

/// Sends datagrams of 60,000 bytes. A process has buffers for 512 datagrams (DatagramRing), whose
/// pages the kernel provides at their first use.
void send_long_fragments(const RawSocket& attacker) {
  constexpr uint32_t kSize = 60'000;
  for (uint32_t sequence = 0; sequence < 2'000; ++sequence) {
    RawDatagram bytes = fragment_header(
        {.sequence = sequence, .message_size = 2 * kSize, .offset = kSize, .number = 1});
    bytes.resize(bytes.size() + kSize, 'x');
    attacker.send(bytes);
  }
}

/// Sends short messages and first fragments of messages that stay incomplete, each on a new
/// channel: `first` to `end` - 1.
void send_invented_channels(const RawSocket& attacker, uint32_t first, uint32_t end) {
  for (uint32_t i = first; i < end; ++i) {
    const std::string channel = wire::frame_channel("invented" + std::to_string(i));
    attacker.send(short_datagram(i, channel + '\0'));
    const RawFragment fragment = {.sequence = i, .message_size = 1U << 20, .count = 17};
    if (i % 8 == 0) attacker.send(first_fragment(fragment, channel, 100));
  }
}

class AttackedStudio : public Studio4 {
 protected:
  /// At live quality, the processor time of a mesh does not depend on the load of the machine. At
  /// 5 Hz, a busy machine records whole takes.
  AttackedStudio() : Studio4({.more = "quality = \"live\"\n", .rate = "5"}) {
    watch_.emplace(
        std::vector<std::string>{bin("v3dctl"), "watch", "--studio", folder_ / "studio.toml"},
        folder_ / "watch.log");
    std::string text = read_file(folder_ / "studio.toml");
    replace(text, "\"studio.key\"", "\"missing.key\"");
    test::write_text(folder_ / "keyless.toml", text);
    keyless_watch_.emplace(
        std::vector<std::string>{bin("v3dctl"), "watch", "--studio", folder_ / "keyless.toml"},
        folder_ / "keyless-watch.log");
  }
  /// Without a key, `v3dctl health` shows both nodes and ends by itself: with 0, or with 3 when a
  /// node of the busy studio was silent for 2.5 s.
  void expect_keyless_health() const {
    ChildProcess health({bin("v3dctl"), "health", "--studio", folder_ / "keyless.toml"},
                        folder_ / "keyless-health.log");
    EXPECT_THAT(health.wait(within(60)), testing::Optional(testing::AnyOf(0, 3)))
        << health.output();
    EXPECT_THAT(health.output(),
                testing::AllOf(testing::HasSubstr("cap01"), testing::HasSubstr("recon01")));
  }
  /// Waits until both daemons have received all earlier datagrams: sends forged commands until both
  /// have counted one after them. The kernel may drop some behind a flood.
  void wait_until_all_is_received() {
    const double by_recon = value("recon01", "commands_forged");
    const double by_capture = value("cap01", "commands_forged");
    bus::Bus bus(studio_.network.lcm_url);
    bus.authenticator().set_key(wire::StudioKey::load(studio_.network.key));
    const wire::StudioKey other_key = wire::StudioKey::make();
    wire::CommandMessage command;
    command.sender = "attacker";
    const auto are_counted = [&] {
      bus.publish_command(encode_with_mac(command, other_key));
      return value("recon01", "commands_forged") > by_recon &&
             value("cap01", "commands_forged") > by_capture;
    };
    EXPECT_TRUE(becomes_true(are_counted, within(60))) << log();
  }
  double processor_s() const {
    return test::sample(captured_->pid()).processor_s + test::sample(recond_->pid()).processor_s;
  }
  /// All processes still run, stop is executed, and the take is complete.
  void expect_all_run_and_stop() {
    EXPECT_TRUE(captured_->runs()) << log();
    EXPECT_TRUE(recond_->runs()) << log();
    EXPECT_TRUE(watch_->runs()) << watch_->output();
    EXPECT_TRUE(keyless_watch_->runs()) << keyless_watch_->output();
    expect_keyless_health();
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    EXPECT_TRUE(stopped.done()) << text_of(stopped) << log();
    EXPECT_TRUE(verify_take(take()).whole()) << verify_take(take()).ledger.verdict();
  }

  RawSocket attacker_{studio_.network.lcm_url};
  std::optional<ChildProcess> watch_, keyless_watch_;
};

TEST_F(AttackedStudio, survives_channels_without_a_NUL) {
  arm_and_start(0);
  send_channels_without_nul(attacker_);
  wait_until_all_is_received();
  EXPECT_TRUE(reaches("cap01", "datagrams_malformed", kRounds));
  expect_all_run_and_stop();
}

TEST_F(AttackedStudio, survives_fragments_whose_offset_wraps) {
  arm_and_start(0);
  for (uint32_t i = 0; i < kRounds; ++i) send_offsets_that_wrap(attacker_);
  wait_until_all_is_received();
  EXPECT_TRUE(reaches("recon01", "datagrams_malformed", 50)) << log();
  expect_all_run_and_stop();
}

TEST_F(AttackedStudio, does_not_hash_datagrams_that_claim_a_large_message) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 10)) << log();
  const MonotonicInstant start = Monotonic::now();
  const double at_start_s = processor_s();
  ASSERT_TRUE(reaches("cap01", "frames_written", 130)) << log();
  const MonotonicInstant sent = Monotonic::now();
  const double at_sent_s = processor_s();
  send_large_claims(attacker_);
  wait_until_all_is_received();
  // Both daemons record and reconstruct meanwhile.
  const double of_a_core = (at_sent_s - at_start_s) / to_seconds(sent - start);
  const double to_record_s = of_a_core * to_seconds(Monotonic::now() - sent);
  EXPECT_LT(processor_s() - at_sent_s, to_record_s + 2);
  expect_all_run_and_stop();
}

TEST_F(AttackedStudio, does_not_grow_with_invented_channels) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  // The first flood delays the disk, so the queues take memory, up to 10 MB on a busy machine.
  send_long_fragments(attacker_);
  send_invented_channels(attacker_, 0, 50'000);
  wait_until_all_is_received();
  const double before_kb = test::sample(captured_->pid()).resident_kb;
  send_invented_channels(attacker_, 50'000, 250'000);
  wait_until_all_is_received();
  EXPECT_TRUE(reaches("cap01", "datagrams_foreign", 1000)) << log();
  EXPECT_LT(test::sample(captured_->pid()).resident_kb - before_kb, 12 * 1024);
  expect_all_run_and_stop();
}

}  // namespace
}  // namespace v3d
