#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "codec/frame_header.h"
#include "codec/occupancy.h"
#include "codec/v3d_decoder.h"
#include "support/allocation_count.h"
#include "tests/codec/coded_scene.h"
#include "tests/codec/motion_scene.h"

namespace v3d::codec {
namespace {

using Decoder = std::unique_ptr<v3d_decoder, decltype(&v3d_decoder_free)>;

std::vector<uint8_t> coloured_ball(double radius, int64_t pulse) {
  Scene scene(ball(radius));
  scene.paint(3);
  return FrameEncoder({}).encode(scene.content(pulse)).value();
}

v3d_status decode(const Decoder& decoder, const std::vector<uint8_t>& bytes) {
  return v3d_decoder_decode(decoder.get(), bytes.data(), bytes.size());
}

TEST(DecoderMemory, leaves_no_frame_of_freed_memory_wherever_it_is_exhausted) {
  const std::vector<uint8_t> small = coloured_ball(3, 0), large = coloured_ball(12, 1);
  int failures = 0;
  for (int n = 1;; ++n) {
    const Decoder decoder(v3d_decoder_new(), v3d_decoder_free);
    ASSERT_EQ(decode(decoder, small), V3D_OK);
    test::fail_allocation(n);
    const v3d_status status = decode(decoder, large);
    test::fail_allocation(0);
    if (status == V3D_OK) break;
    ++failures;
    ASSERT_EQ(status, V3D_OUT_OF_MEMORY) << n;
    ASSERT_EQ(v3d_decoder_frame(decoder.get()), nullptr) << n;
    ASSERT_EQ(decode(decoder, large), V3D_OK) << n;
    ASSERT_EQ(v3d_decoder_frame(decoder.get())->pulse, 1) << n;
  }
  EXPECT_GT(failures, 10);
}

/// A key frame whose box of this size, bricks, has no voxel.
std::vector<uint8_t> empty_box(int64_t pulse, const std::array<int, 3>& size,
                               std::vector<uint8_t> shape) {
  FrameHeader header;
  header.metadata.pulse = header.key_pulse = pulse;
  header.metadata.step = 0.01;
  for (size_t axis = 0; axis < 3; ++axis) header.bricks[axis] = static_cast<uint16_t>(size[axis]);
  Sections sections;
  sections[kShape] = std::move(shape);
  return write_frame(header, sections);
}

TEST(DecoderMemory, is_not_reserved_for_a_box_with_too_many_rows) {
  const Decoder decoder(v3d_decoder_new(), v3d_decoder_free);
  const std::vector<uint8_t> frame = empty_box(0, {1, 4096, 4096}, {0});
  test::forget_peak();
  const int64_t before = test::live_bytes();
  EXPECT_EQ(decode(decoder, frame), V3D_MALFORMED);
  EXPECT_LT(test::peak_bytes() - before, 1 << 20);
}

TEST(DecoderMemory, of_two_frames_with_the_most_rows_is_a_small_part_of_its_limit) {
  constexpr std::array<int, 3> kSize{1, 1024, 1024};
  Occupancy volume;
  volume.clear({0, 0, 0}, kSize);
  const std::vector<uint8_t> shape = encode_occupancy(volume);
  const std::vector<uint8_t> first = empty_box(0, kSize, shape),
                             second = empty_box(1, kSize, shape);
  const Decoder decoder(v3d_decoder_new(), v3d_decoder_free);
  test::forget_peak();
  const int64_t before = test::live_bytes();
  EXPECT_EQ(decode(decoder, first), V3D_OK);
  EXPECT_EQ(decode(decoder, second), V3D_OK);
  EXPECT_LT(test::peak_bytes() - before, 200'000'000);
}

using Motion = std::unique_ptr<v3d_motion, decltype(&v3d_motion_free)>;

/// A motion file whose segment 0 is decoded.
Motion opened(const std::vector<uint8_t>& file) {
  v3d_motion* motion = nullptr;
  EXPECT_EQ(v3d_motion_open(&motion, file.data(), file.size()), V3D_OK);
  EXPECT_NE(v3d_motion_decode(motion, 0, 0), nullptr);
  return {motion, v3d_motion_free};
}

std::vector<float> positions_of(const v3d_motion_pulse* pulse, size_t vertices) {
  return pulse == nullptr ? std::vector<float>()
                          : std::vector<float>(pulse->positions, pulse->positions + 3 * vertices);
}

TEST(DecoderMemory, decodes_a_segment_whose_memory_was_exhausted_before_as_a_fresh_decoder_does) {
  MotionSegment first = moving_tube(3, 6, 5), second = moving_tube(3, 6, 5);
  for (int64_t& pulse : second.pulses) pulse += 10;
  paint(first, 3);
  paint(second, 3);
  const std::vector<uint8_t> file = motion_file({first, second});
  const size_t vertices = second.positions[0].size();
  const Motion fresh = opened(file);
  const auto expected = positions_of(v3d_motion_decode(fresh.get(), 1, 0), vertices);
  ASSERT_FALSE(expected.empty());
  int failures = 0;
  for (int n = 1;; ++n) {
    const Motion motion = opened(file);
    test::fail_allocation(n);
    const v3d_motion_pulse* pulse = v3d_motion_decode(motion.get(), 1, 0);
    test::fail_allocation(0);
    if (pulse != nullptr) break;
    ++failures;
    ASSERT_EQ(positions_of(v3d_motion_decode(motion.get(), 1, 0), vertices), expected) << n;
    ASSERT_NE(v3d_motion_decode(motion.get(), 0, 0), nullptr) << n;
  }
  EXPECT_GT(failures, 10);
}

}  // namespace
}  // namespace v3d::codec
