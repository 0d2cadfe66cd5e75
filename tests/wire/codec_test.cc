#include "wire/codec.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "message_generators.h"

namespace v3d::wire {
namespace {

using test::any_message;

/// Calls check(M{}) for every message type.
template <class Check>
void for_every_type(Check check) {
  check(PulseMessage{});
  check(FrameMessage{});
  check(MeshMessage{});
  check(CommandMessage{});
  check(ReplyMessage{});
  check(HealthMessage{});
  check(EventMessage{});
  check(PreviewMessage{});
  check(SessionMessage{});
  check(FrameKeyMessage{});
  check(ShardMessage{});
  check(ShardMeshMessage{});
}

FrameMessage small_frame() {
  FrameMessage m;
  m.take = "kendo-07";
  m.frame.camera = "cam07";
  m.frame.label.pulse = 41;
  m.frame.sensor_size = {8, 4};
  m.frame.mask = Mask({8, 4});
  m.frame.mask->fill_row(2, 3, 6);
  m.frame.roi = {2, 0, 4, 4};
  m.frame.image = Image({4, 4}, PixelFormat::kBayerRG8);
  return m;
}

RC_GTEST_PROP(Codec, encodes_a_decoded_message_to_the_same_bytes, ()) {
  for_every_type([]<class M>(M) {
    const Bytes bytes = encode(any_message<M>());
    const auto message = decode<M>(bytes);
    RC_ASSERT(message.has_value());
    RC_ASSERT(encode(*message) == bytes);
  });
}

RC_GTEST_PROP(Codec, keeps_every_field_of_a_frame, ()) {
  const auto m = any_message<FrameMessage>();
  const auto back = decode<FrameMessage>(encode(m));
  RC_ASSERT(back.has_value());
  RC_ASSERT(back->sent == m.sent);
  RC_ASSERT(back->seq == m.seq);
  RC_ASSERT(back->take == m.take);
  RC_ASSERT(back->frame.camera == m.frame.camera);
  RC_ASSERT(back->frame.label == m.frame.label);
  RC_ASSERT(back->frame.sensor_size == m.frame.sensor_size);
  RC_ASSERT(back->frame.mask == m.frame.mask);
  RC_ASSERT(back->frame.roi == m.frame.roi);
  RC_ASSERT(back->frame.image.size == m.frame.image.size);
  RC_ASSERT(back->frame.image.format == m.frame.image.format);
  RC_ASSERT(back->frame.image.bytes == m.frame.image.bytes);
}

RC_GTEST_PROP(Codec, keeps_every_field_of_a_command, ()) {
  const auto m = any_message<CommandMessage>();
  const auto back = decode<CommandMessage>(encode(m));
  RC_ASSERT(back.has_value());
  RC_ASSERT(back->sender == m.sender);
  RC_ASSERT(back->counter == m.counter);
  RC_ASSERT(back->verb == m.verb);
  RC_ASSERT(back->take == m.take);
  RC_ASSERT(back->rate_hz == m.rate_hz);
  RC_ASSERT(back->pulses == m.pulses);
  RC_ASSERT(back->allow_missing == m.allow_missing);
  RC_ASSERT(back->to == m.to);
  RC_ASSERT(back->nonces == m.nonces);
}

RC_GTEST_PROP(Codec, keeps_every_field_of_a_health_message, ()) {
  const auto m = any_message<HealthMessage>();
  const auto back = decode<HealthMessage>(encode(m));
  RC_ASSERT(back.has_value());
  RC_ASSERT(back->program == m.program);
  RC_ASSERT(back->version == m.version);
  RC_ASSERT(back->state == m.state);
  RC_ASSERT(back->text == m.text);
  RC_ASSERT(back->values == m.values);
  RC_ASSERT(back->texts == m.texts);
}

RC_GTEST_PROP(Codec, keeps_every_field_of_a_shard_message, ()) {
  const auto m = any_message<ShardMessage>();
  const auto back = decode<ShardMessage>(encode(m));
  RC_ASSERT(back.has_value());
  RC_ASSERT(back->node == m.node);
  RC_ASSERT(back->take == m.take);
  RC_ASSERT(back->first == m.first);
  RC_ASSERT(back->done == m.done);
  RC_ASSERT(back->ordered == m.ordered);
  RC_ASSERT(back->shown == m.shown);
  RC_ASSERT(back->given_up == m.given_up);
}

RC_GTEST_PROP(Codec, rejects_a_message_truncated_at_any_length, ()) {
  for_every_type([]<class M>(M) {
    const Bytes bytes = encode(any_message<M>());
    for (size_t length = 0; length < bytes.size(); ++length) {
      RC_ASSERT(!decode<M>(std::span(bytes).first(length)).has_value());
    }
  });
}

RC_GTEST_PROP(Codec, rejects_bytes_after_a_message, ()) {
  for_every_type([]<class M>(M) {
    Bytes bytes = encode(any_message<M>());
    bytes.push_back(0);
    RC_ASSERT(!decode<M>(bytes).has_value());
  });
}

RC_GTEST_PROP(Codec, handles_any_single_changed_byte, ()) {
  for_every_type([]<class M>(M) {
    Bytes bytes = encode(any_message<M>());
    for (size_t i = 0; i < bytes.size(); ++i) {
      const uint8_t original = bytes[i];
      bytes[i] = *rc::gen::arbitrary<uint8_t>();
      if (const auto message = decode<M>(bytes)) encode(*message);
      bytes[i] = original;
    }
  });
}

RC_GTEST_PROP(Codec, rejects_random_bytes, (const Bytes& noise)) {
  for_every_type([&]<class M>(M) { RC_ASSERT(!decode<M>(noise).has_value()); });
}

TEST(Codec, rejects_a_message_of_another_type) {
  const Bytes frame = encode(small_frame());
  EXPECT_FALSE(decode<PulseMessage>(frame));
  EXPECT_FALSE(decode<MeshMessage>(frame));
}

// Each call breaks one rule of a frame that is otherwise valid.
TEST(Codec, rejects_a_frame_with_inconsistent_fields) {
  const auto is_rejected = [](auto breakage) {
    FrameMessage m = small_frame();
    breakage(m);
    return !decode<FrameMessage>(encode(m)).has_value();
  };
  EXPECT_FALSE(is_rejected([](FrameMessage&) {}));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.sensor_size = {0, 4}; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.sensor_size = {8, kMaxImageSide + 1}; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.roi.x0 = 6; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.roi.x0 = -2; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.roi.x0 = 1; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.roi.width = 3; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.roi = {0, 0, -4, -4}; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.image.bytes.pop_back(); }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.image.format = PixelFormat::kRGB8; }));
  EXPECT_TRUE(
      is_rejected([](FrameMessage& m) { m.frame.image.format = static_cast<PixelFormat>(7); }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.mask = Mask({7, 4}); }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.frame.label.pulse = -2; }));
  EXPECT_TRUE(is_rejected([](FrameMessage& m) { m.seq = -1; }));
}

/// Whether a default message with one changed field is rejected.
template <class M>
bool is_rejected(auto set_field) {
  M m;
  set_field(m);
  return !decode<M>(encode(m)).has_value();
}

TEST(Codec, rejects_values_outside_their_enumeration) {
  EXPECT_TRUE(is_rejected<CommandMessage>([](CommandMessage& m) {
    m.sender = "v3dctl";
    m.verb = static_cast<CommandVerb>(8);
  }));
  EXPECT_TRUE(
      is_rejected<HealthMessage>([](HealthMessage& m) { m.state = static_cast<NodeState>(0); }));
  EXPECT_TRUE(
      is_rejected<EventMessage>([](EventMessage& m) { m.severity = static_cast<Severity>(9); }));
}

TEST(Codec, rejects_invalid_pulses_of_a_shard) {
  EXPECT_FALSE(is_rejected<ShardMessage>([](ShardMessage& m) { m.first = 0; }));
  EXPECT_TRUE(is_rejected<ShardMessage>([](ShardMessage& m) { m.first = -2; }));
  EXPECT_TRUE(is_rejected<ShardMessage>([](ShardMessage& m) { m.done = INT64_MIN; }));
  EXPECT_TRUE(is_rejected<ShardMessage>([](ShardMessage& m) { m.given_up = {3, -1}; }));
}

TEST(Codec, rejects_a_mesh_of_a_shard_as_a_mesh_in_order) {
  EXPECT_FALSE(decode<MeshMessage>(encode(ShardMeshMessage{})));
}

TEST(Codec, rejects_a_preview_that_is_too_large_or_has_a_mask_of_another_size) {
  const auto with = [](ImageSize size, std::optional<Mask> mask) {
    return [=](PreviewMessage& m) {
      m.size = size;
      m.mask = mask;
    };
  };
  EXPECT_FALSE(is_rejected<PreviewMessage>(with({8, 4}, Mask({8, 4}))));
  EXPECT_FALSE(is_rejected<PreviewMessage>(with({kMaxPreviewSide, 4}, {})));
  EXPECT_TRUE(is_rejected<PreviewMessage>(with({kMaxPreviewSide + 1, 4}, {})));
  EXPECT_TRUE(is_rejected<PreviewMessage>(with({0, 4}, {})));
  EXPECT_TRUE(is_rejected<PreviewMessage>(with({8, 4}, Mask({7, 4}))));
}

TEST(Codec, rejects_a_frame_key_message_with_too_many_keys_or_a_part_of_one) {
  const auto with = [](size_t count) {
    return [count](FrameKeyMessage& m) { m.keys.resize(count); };
  };
  EXPECT_FALSE(is_rejected<FrameKeyMessage>(with(0)));
  EXPECT_FALSE(is_rejected<FrameKeyMessage>(with(kMaxFrameKeyRecipients)));
  EXPECT_TRUE(is_rejected<FrameKeyMessage>(with(kMaxFrameKeyRecipients + 1)));
  Bytes bytes = encode(FrameKeyMessage{.sent = {}, .session = 1, .newest = 2, .keys = {{}}});
  constexpr size_t kEntrySize = 88;
  uint8_t& count = bytes[bytes.size() - kEntrySize - 1];
  ASSERT_EQ(count, kEntrySize);
  --count;
  bytes.pop_back();
  EXPECT_FALSE(decode<FrameKeyMessage>(bytes));
}

TEST(Codec, rejects_a_command_without_a_sender_or_with_an_invalid_rate) {
  const auto rate = [](double hz) {
    return [hz](CommandMessage& m) {
      m.sender = "v3dctl";
      m.rate_hz = hz;
    };
  };
  EXPECT_FALSE(is_rejected<CommandMessage>(rate(25)));
  EXPECT_TRUE(is_rejected<CommandMessage>(rate(-1)));
  EXPECT_TRUE(is_rejected<CommandMessage>(rate(std::numeric_limits<double>::quiet_NaN())));
  EXPECT_TRUE(is_rejected<CommandMessage>([](CommandMessage& m) { m.sender.clear(); }));
}

TEST(Codec, rejects_a_frame_with_a_pixel_count_of_two_gigabytes) {
  Bytes bytes = encode(small_frame());
  const size_t count = bytes.size() - 16 - encode_runs(*small_frame().frame.mask).size() - 4;
  ASSERT_EQ(bytes[count + 3], 16);
  bytes[count] = 0x7f;
  EXPECT_FALSE(decode<FrameMessage>(bytes));
  bytes[count] = 0xff;
  EXPECT_FALSE(decode<FrameMessage>(bytes));
}

TEST(Codec, rejects_a_frame_with_any_changed_bit) {
  Bytes bytes = encode(small_frame());
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] = static_cast<uint8_t>(bytes[bit / 8] ^ 1U << bit % 8);
    EXPECT_FALSE(decode<FrameMessage>(bytes)) << "bit " << bit;
    bytes[bit / 8] = static_cast<uint8_t>(bytes[bit / 8] ^ 1U << bit % 8);
  }
  EXPECT_TRUE(decode<FrameMessage>(bytes));
}

RC_GTEST_PROP(FrameHead, has_the_label_and_the_size_of_the_message, ()) {
  const auto m = any_message<FrameMessage>();
  const Bytes bytes = encode(m);
  const auto head = decode_frame_head(bytes);
  RC_ASSERT(head.has_value());
  RC_ASSERT(head->label == m.frame.label);
  RC_ASSERT(head->camera == m.frame.camera);
  RC_ASSERT(head->message_size == bytes.size());
}

TEST(FrameHead, is_decoded_from_kFrameHeadSize_bytes_of_a_frame) {
  FrameMessage m = small_frame();
  m.take = m.frame.camera = std::string(64, 'a');
  const Bytes bytes = encode(m);
  ASSERT_EQ(bytes.size() - 16 - encode_runs(*m.frame.mask).size(), 241U);
  EXPECT_TRUE(decode_frame_head(std::span(bytes).first(241)));
  static_assert(kFrameHeadSize > 241);
}

TEST(FrameHead, is_not_decoded_from_a_truncated_head) {
  const Bytes bytes = encode(small_frame());
  const size_t pixels = 16 + encode_runs(*small_frame().frame.mask).size();
  for (size_t length = 0; length < bytes.size() - pixels; ++length) {
    EXPECT_FALSE(decode_frame_head(std::span(bytes).first(length)));
  }
}

}  // namespace
}  // namespace v3d::wire
