// Compatibility test: encoded bytes of one message of every type. These bytes must not change,
// because takes on disk and programs built elsewhere from lcmtypes/ use them.
#include <gtest/gtest.h>

#include "wire/codec.h"

namespace v3d::wire {
namespace {

std::string hex(const Bytes& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const uint8_t byte : bytes) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

constexpr RealtimeInstant kSent = from_ns<Realtime>(1'700'000'000'123'456'000);

Mask small_mask() {
  Mask mask({8, 4});
  mask.fill_row(1, 2, 5);
  mask.fill_row(2, 0, 8);
  return mask;
}

PulseMessage pulse() {
  return {.sent = kSent,
          .seq = 3,
          .take = "kendo-07",
          .pulse = 41,
          .edge = from_ns<Realtime>(1'700'000'000'100'000'001),
          .edge_monotonic = from_ns<Monotonic>(5'000'000'002)};
}

FrameMessage frame() {
  FrameMessage m{.sent = kSent, .seq = 4, .take = "kendo-07", .frame = {}};
  m.frame.camera = "cam07";
  m.frame.label = {.pulse = 41,
                   .suspect = true,
                   .camera_counter = 77,
                   .device_time = from_ns<DeviceClock>(123'456'789),
                   .received = from_ns<Realtime>(1'700'000'000'110'000'003)};
  m.frame.sensor_size = {8, 4};
  m.frame.mask = small_mask();
  m.frame.roi = {2, 0, 4, 2};
  m.frame.image = Image({4, 2}, PixelFormat::kBayerRG8);
  for (size_t i = 0; i < 8; ++i) m.frame.image.bytes[i] = static_cast<uint8_t>(10 * i);
  return m;
}

template <class M = MeshMessage>
M mesh() {
  M m;
  m.sent = kSent;
  m.seq = 5;
  m.take = "kendo-07";
  m.pulse = 41;
  m.pulse_edge = from_ns<Realtime>(1'700'000'000'100'000'001);
  m.silhouette_iou = 0.9375;
  m.coverage = 0.75;
  m.cameras = 14;
  m.missing = {"cam03"};
  m.compact = {1, 2, 3};
  return m;
}

ShardMeshMessage shard_mesh() {
  auto m = mesh<ShardMeshMessage>();
  m.node = "recon02";
  return m;
}

ShardMessage shard() {
  return {.sent = kSent,
          .seq = 6,
          .take = "kendo-07",
          .node = "recon02",
          .first = 2,
          .done = 40,
          .ordered = 39,
          .shown = -1,
          .given_up = {7, 9}};
}

CommandMessage command() {
  return {.sent = kSent,
          .sender = "anna@desk/1/2",
          .counter = 8,
          .verb = CommandVerb::kCommit,
          .own_only = true,
          .take = "kendo-07",
          .rate_hz = 12.5,
          .pulses = 250,
          .allow_missing = {"cam03"},
          .to = {"cap01", "recon02"},
          .nonces = {0x0102030405060708, 9}};
}

ReplyMessage reply() {
  return {.sent = kSent,
          .node = "cap01",
          .command_sender = "anna@desk/1/2",
          .command_counter = 8,
          .command_sent = kSent - std::chrono::seconds(1),
          .nonce = 0x0102030405060708,
          .outcome = ReplyMessage::Outcome::kRefused,
          .take = "kendo-07",
          .text = "not armed",
          .detail = "{}"};
}

SessionMessage session() {
  return {.sent = kSent, .session = 0xfedcba98, .newest = 77, .nonce = 9, .is_answer = true};
}

FrameKeyMessage frame_key() {
  FrameKeyMessage m{.sent = kSent, .session = 0xfedcba98, .newest = 77, .keys = {{}}};
  m.keys[0].recipient.fill(3);
  m.keys[0].sealed.fill(4);
  return m;
}

HealthMessage health() {
  return {.sent = kSent,
          .seq = 9,
          .node = "cap01",
          .program = "v3d-captured",
          .version = "0.1.0",
          .state = NodeState::kRecording,
          .take = "kendo-07",
          .text = "cam03 lost",
          .values = {{"frames_missing", 2}, {"rate_hz", 24.5}},
          .texts = {{"cam01.firmware", "1.2"}}};
}

EventMessage event() {
  return {.sent = kSent,
          .seq = 10,
          .node = "cap01",
          .severity = Severity::kAlarm,
          .subject = "cam03",
          .text = "lost"};
}

PreviewMessage preview() {
  return {.sent = kSent,
          .seq = 11,
          .camera = "cam07",
          .pulse = 41,
          .size = {8, 4},
          .mask = small_mask(),
          .jpeg = {0xff, 0xd8, 0xff}};
}

/// Expects that the message encodes to these bytes and that they decode to the message.
template <class M>
void expect_bytes(const M& message, const std::string& expected) {
  const Bytes bytes = encode(message);
  EXPECT_EQ(hex(bytes), expected);
  const auto back = decode<M>(bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(hex(encode(*back)), expected);
}

TEST(GoldenBytes, match_for_a_pulse) {
  expect_bytes(pulse(),
               "67603eb2e3a4875d00060a24182022400000000000000003000000096b656e646f2d303700000000"
               "000000002917979cfe3c1fe101000000012a05f202");
}
TEST(GoldenBytes, match_for_a_frame) {
  expect_bytes(frame(),
               "cda611848afd6cd200060a24182022400000000000000004000000096b656e646f2d303700000000"
               "0663616d303700000000000000002901000000000000004d00000000075bcd1517979cfe3cb87783"
               "000000080000000400000002000000000000000400000002010800090001e92e4448008e17390000"
               "0005000000080a03030808000a141e28323c46");
}
TEST(GoldenBytes, match_for_a_mesh) {
  expect_bytes(mesh(),
               "d9eaf266b70ef7c100060a24182022400000000000000005000000096b656e646f2d303700000000"
               "000000002917979cfe3c1fe1013fee0000000000003fe80000000000000000000e00000001000000"
               "030000000663616d303300010203");
}
TEST(GoldenBytes, match_for_a_mesh_of_a_shard) {
  expect_bytes(shard_mesh(),
               "8ebf2924c8dbba4100060a24182022400000000000000005000000096b656e646f2d303700000000"
               "000000002917979cfe3c1fe1013fee0000000000003fe80000000000000000000e00000001000000"
               "030000000663616d303300010203000000087265636f6e303200");
}
TEST(GoldenBytes, match_for_a_shard_message) {
  expect_bytes(shard(),
               "732f15d60ce28b1200060a24182022400000000000000006000000096b656e646f2d303700000000"
               "087265636f6e303200000000000000000200000000000000280000000000000027ffffffffffffff"
               "ff0000000200000000000000070000000000000009");
}
TEST(GoldenBytes, match_for_a_command) {
  expect_bytes(command(),
               "fbd8b097708b2f2c00060a24182022400000000e616e6e61406465736b2f312f3200000000000000"
               "00080601000000096b656e646f2d303700402900000000000000000000000000fa00000001000000"
               "020000000663616d30330000000006636170303100000000087265636f6e30320001020304050607"
               "08000000000000000900000000000000000000000000000000000000000000000000000000000000"
               "00");
}
TEST(GoldenBytes, match_for_a_reply) {
  expect_bytes(reply(),
               "4920245360d3d58500060a2418202240000000066361703031000000000e616e6e61406465736b2f"
               "312f3200000000000000000800060a241810e000010203040506070803000000096b656e646f2d30"
               "37000000000a6e6f742061726d656400000000037b7d000000000000000000000000000000000000"
               "000000000000000000000000000000");
}
TEST(GoldenBytes, match_for_a_session_message) {
  expect_bytes(session(), "8ec65f99c61dd5d300060a2418202240fedcba980000004d000000000000000901");
}
TEST(GoldenBytes, match_for_a_frame_key_message) {
  std::string sealed;
  for (int i = 0; i < 80; ++i) sealed += "04";
  expect_bytes(frame_key(), "26186c1da8f8c3d300060a2418202240fedcba980000004d00000058" +
                                std::string("0303030303030303") + sealed);
}
TEST(GoldenBytes, match_for_a_health_message) {
  expect_bytes(health(),
               "502a902f49daae0a00060a24182022400000000000000009000000066361703031000000000d7633"
               "642d63617074757265640000000006302e312e300003000000096b656e646f2d3037000000000b63"
               "616d3033206c6f737400000000020000000f6672616d65735f6d697373696e670000000008726174"
               "655f687a0040000000000000004038800000000000000000010000000f63616d30312e6669726d77"
               "6172650000000004312e3200");
}
TEST(GoldenBytes, match_for_an_event) {
  expect_bytes(event(),
               "803af0e42055a23b00060a2418202240000000000000000a00000006636170303100030000000663"
               "616d303300000000056c6f737400");
}
TEST(GoldenBytes, match_for_a_preview) {
  expect_bytes(preview(),
               "a6dba968470d526000060a2418202240000000000000000b0000000663616d303700000000000000"
               "002900000008000000040100000005000000030a03030808ffd8ff");
}

TEST(GoldenBytes, match_for_the_head_of_a_frame_and_the_start_of_the_frame) {
  const Bytes head = encode_head(frame());
  const Bytes whole = encode(frame());
  ASSERT_EQ(head.size() + frame().frame.image.bytes.size(), whole.size());
  EXPECT_EQ(hex(whole).substr(0, 2 * head.size()), hex(head));
}

}  // namespace
}  // namespace v3d::wire
