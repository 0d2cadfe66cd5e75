#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "capture/cameras/aravis_camera.h"

namespace v3d::capture {
namespace {

/// The 16-bit block number of exposure n of a GigE Vision camera, which skips 0.
uint64_t block_id(uint64_t n) { return (n - 1) % 65535 + 1; }

TEST(FrameCounter, continues_from_65535_to_1) {
  FrameCounter counter;
  const uint64_t before = counter.unwrap(65535);
  EXPECT_EQ(counter.unwrap(1), before + 1);
  EXPECT_EQ(counter.unwrap(2), before + 2);
}

TEST(FrameCounter, unwraps_the_number_of_a_late_frame) {
  FrameCounter counter;
  const uint64_t first = counter.unwrap(1);
  EXPECT_EQ(counter.unwrap(65535), first - 1);
  EXPECT_EQ(counter.unwrap(2), first + 1);
}

TEST(FrameCounter, does_not_wrap_64_bit_numbers) {
  FrameCounter counter;
  const uint64_t before = counter.unwrap(65535);
  EXPECT_EQ(counter.unwrap(65536), before + 1);
  EXPECT_EQ(counter.unwrap(1'000'000), before + 1'000'000 - 65535);
}

RC_GTEST_PROP(FrameCounter, counts_every_exposure_for_any_loss_in_between, ()) {
  FrameCounter counter;
  auto n = *rc::gen::inRange<uint64_t>(1, 200'000);
  uint64_t previous = counter.unwrap(block_id(n));
  for (int frame = 0; frame < 200; ++frame) {
    const auto gap = *rc::gen::inRange<uint64_t>(1, 32'700);
    n += gap;
    const uint64_t now = counter.unwrap(block_id(n));
    RC_ASSERT(now - previous == gap);
    previous = now;
  }
}

}  // namespace
}  // namespace v3d::capture
