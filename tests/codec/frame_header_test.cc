#include "codec/frame_header.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "codec/frame_codec.h"
#include "tests/codec/coded_scene.h"

namespace v3d::codec {
namespace {

TEST(FrameCodec, keeps_the_metadata_of_a_frame) {
  const Scene scene(ball(10));
  FrameDecoder decoder;
  ASSERT_EQ(decoder.decode(FrameEncoder({}).encode(scene.content(9)).value()), DecodeStatus::kOk);
  const FrameMetadata& metadata = decoder.frame().metadata;
  const FrameMetadata expected = scene.content(9).metadata;
  EXPECT_EQ(metadata.pulse, 9);
  EXPECT_EQ(decoder.frame().key_pulse, 9);
  EXPECT_EQ(metadata.exposure_ns, expected.exposure_ns);
  EXPECT_EQ(metadata.cameras, expected.cameras);
  EXPECT_EQ(metadata.missing, 3);
  EXPECT_EQ(metadata.quality, 0.75F);
  EXPECT_EQ(metadata.origin, expected.origin);
  EXPECT_EQ(metadata.step, expected.step);
}

template <class Value>
Value any_of(const std::vector<Value>& values) {
  return values[*rc::gen::inRange<size_t>(0, values.size())];
}

RC_GTEST_PROP(FrameCodec, encodes_only_metadata_that_a_decoder_accepts, ()) {
  static const Scene kScene(ball(3));
  FrameContent content = kScene.content(0);
  FrameMetadata& metadata = content.metadata;
  metadata.pulse = any_of<int64_t>({-1, 0, 7, 7, 7});
  metadata.missing = any_of<int>({-1, 0, 0, 256, 257});
  metadata.quality = any_of<float>({-0.1F, 0, 1, 1.5F, 95, NAN, INFINITY});
  metadata.origin[1] = any_of<double>({0, 0, -1e300, NAN, INFINITY});
  metadata.step = any_of<double>({0.01, 0.01, 1e300, 0, -1, NAN, INFINITY});
  metadata.live_passes = any_of<int>({-1, 0, 3, 4});
  metadata.cameras = any_of<std::vector<std::string>>({{}, {"a", "b"}, {"b", "a"}, {"a", "a"}});
  metadata.late_cameras = any_of<std::vector<std::string>>({{}, {}, {"a"}, {"b", "a"}});
  const auto frame = FrameEncoder({}).encode(content);
  RC_ASSERT(frame.has_value() == (metadata_error(metadata) == nullptr));
  if (frame) RC_ASSERT(FrameDecoder().decode(*frame) == DecodeStatus::kOk);
}

TEST(FrameCodec, states_the_passes_of_a_live_deformation_in_version_3_alone) {
  const Scene scene(ball(5));
  for (const int passes : {0, 1, FrameLimits::kPasses}) {
    FrameContent content = scene.content(0);
    content.metadata.live_passes = passes;
    const auto frame = FrameEncoder({}).encode(content).value();
    EXPECT_EQ(frame[8], passes == 0 ? 2 : 3);
    FrameDecoder decoder;
    ASSERT_EQ(decoder.decode(frame), DecodeStatus::kOk);
    EXPECT_EQ(decoder.frame().metadata.live_passes, passes);
  }
  FrameContent content = scene.content(0);
  content.metadata.live_passes = FrameLimits::kPasses + 1;
  EXPECT_FALSE(FrameEncoder({}).encode(content));
}

TEST(FrameCodec, states_late_cameras_in_version_5_alone) {
  const Scene scene(ball(5));
  FrameContent content = scene.content(0);
  const std::vector<std::string> cameras = content.metadata.cameras;
  for (const auto& late : {std::vector<std::string>(), {cameras[1]}, cameras}) {
    content.metadata.late_cameras = late;
    const auto frame = FrameEncoder({}).encode(content).value();
    EXPECT_EQ(frame[8], late.empty() ? 2 : 5);
    FrameDecoder decoder;
    ASSERT_EQ(decoder.decode(frame), DecodeStatus::kOk);
    EXPECT_EQ(decoder.frame().metadata.cameras, cameras);
    EXPECT_EQ(decoder.frame().metadata.late_cameras, late);
    EXPECT_EQ(read_metadata(frame).value().late_cameras, late);
  }
  content.metadata.late_cameras = {"cam03"};
  EXPECT_FALSE(FrameEncoder({}).encode(content)) << "it did not take part";
}

TEST(FrameCodec, rejects_a_mark_of_a_late_camera_without_the_flag_and_the_flag_without_a_mark) {
  const Scene scene(ball(5));
  FrameContent content = scene.content(0);
  content.metadata.late_cameras = {"cam01"};
  const auto frame = FrameEncoder({}).encode(content).value();
  FrameDecoder decoder;
  auto unmarked = frame;
  unmarked[FrameHeader::kBytes] &= 0x7F;
  EXPECT_EQ(decoder.decode(with_valid_checksum(unmarked)), DecodeStatus::kMalformed);
  EXPECT_FALSE(read_metadata(with_valid_checksum(unmarked)));
  auto unflagged = frame;
  unflagged[8] = 2;
  unflagged[16] &= static_cast<uint8_t>(~FrameHeader::kLate);
  EXPECT_EQ(decoder.decode(with_valid_checksum(unflagged)), DecodeStatus::kMalformed);
  EXPECT_EQ(decoder.decode(frame), DecodeStatus::kOk);
}

TEST(FrameCodec, rejects_names_that_are_not_printable_ascii) {
  const Scene scene(ball(5));
  FrameContent content = scene.content(0);
  const auto frame = FrameEncoder({}).encode(content).value();
  constexpr size_t kEndOfFirst = FrameHeader::kBytes + 5;  // of cam01
  constexpr size_t kEndOfSecond = kEndOfFirst + 6;         // of cam02
  const auto decoded_with = [&](size_t at, uint8_t byte) {
    auto changed = frame;
    changed[at] = byte;
    return FrameDecoder().decode(with_valid_checksum(changed));
  };
  EXPECT_EQ(decoded_with(kEndOfFirst, ' '), DecodeStatus::kOk);
  EXPECT_EQ(decoded_with(kEndOfSecond, '~'), DecodeStatus::kOk);
  EXPECT_EQ(decoded_with(kEndOfFirst, 0), DecodeStatus::kMalformed);
  EXPECT_EQ(decoded_with(kEndOfFirst, '\n'), DecodeStatus::kMalformed);
  EXPECT_EQ(decoded_with(kEndOfSecond, 0x7F), DecodeStatus::kMalformed);
  EXPECT_EQ(decoded_with(kEndOfSecond, 0xFF), DecodeStatus::kMalformed);
  for (const std::string& name :
       {std::string("a\0b", 3), std::string("a\nb"), std::string("\xFF")}) {
    content.metadata.cameras = {name};
    EXPECT_FALSE(FrameEncoder({}).encode(content)) << name;
  }
}

TEST(FrameCodec, rejects_headers_that_exceed_a_limit) {
  const auto frame = moving_ball(1)[0];
  const auto accepts = [&](size_t at, std::initializer_list<uint8_t> bytes) {
    auto changed = frame;
    std::copy(bytes.begin(), bytes.end(), changed.begin() + static_cast<std::ptrdiff_t>(at));
    return read_header(with_valid_checksum(changed)).has_value();
  };
  EXPECT_TRUE(accepts(16, {1, 0}));
  EXPECT_FALSE(accepts(16, {0x11, 0}));        // unknown flag
  EXPECT_FALSE(accepts(16, {9, 0}));           // explicit, without positions
  EXPECT_FALSE(accepts(22, {0, 0}));           // subdivision
  EXPECT_FALSE(accepts(40, {1}));              // a key frame that references another one
  EXPECT_FALSE(accepts(52, {0, 0, 0, 0x40}));  // quality 2
  EXPECT_FALSE(accepts(88, {0}));              // step of luma
  EXPECT_FALSE(accepts(91, {1}));              // passes, of which version 2 has none
  EXPECT_FALSE(accepts(8, {3}));               // version 3 without passes
  EXPECT_FALSE(accepts(8, {4}));               // version 4 without colours of cameras
  EXPECT_FALSE(accepts(8, {5}));               // version 5 without a late camera
  EXPECT_FALSE(accepts(8, {6}));               // an unknown version
  EXPECT_FALSE(accepts(92, {1, 0, 64, 0}));    // vertices: 2^22 + 1
  EXPECT_FALSE(accepts(96, {1, 0, 128, 0}));   // triangles: 2^23 + 1
  EXPECT_TRUE(accepts(100, {0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 1}));   // 256^3 bricks
  EXPECT_FALSE(accepts(100, {0, 0, 0, 0, 0, 0, 1, 1, 0, 1, 0, 1}));  // one layer more
  EXPECT_FALSE(accepts(100, {0, 16}));                               // beyond 4096 along x
  EXPECT_TRUE(accepts(100, {0, 0, 0, 0, 0, 0, 1, 0, 0, 4, 0, 4}));   // 1 x 1024 x 1024 bricks
  EXPECT_FALSE(accepts(100, {0, 0, 0, 0, 0, 0, 1, 0, 1, 4, 0, 4}));  // one row more in each layer
  EXPECT_FALSE(accepts(112, {0xFF, 0xFF, 0xFF, 0xFF}));              // names
}

}  // namespace
}  // namespace v3d::codec
