#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "codec/v3d_decoder.h"
#include "support/allocation_count.h"
#include "tests/codec/coded_scene.h"

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

}  // namespace
}  // namespace v3d::codec
