// Cameras that send more than 8 bits, with the real daemons.
#include <gmock/gmock.h>

#include "studio4.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"

namespace v3d::test {
namespace {

using testing::IsEmpty;

constexpr int kPulses = 20;

/// The simulated cameras put the index of a pixel into the low bits of its sample.
class TwelveBitStudio : public Studio4, public testing::WithParamInterface<const char*> {
 protected:
  TwelveBitStudio() : Studio4({.simulator = {"--format", GetParam()}}) {}
};

TEST_P(TwelveBitStudio, keeps_all_bits_in_the_take_and_has_a_mesh_of_every_pulse) {
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, IsEmpty());
  EXPECT_EQ(take::MeshFileReader(take().mesh()).pulses().size(), kPulses) << log();
  for (const char* camera : {"cam01", "cam02", "cam03", "cam04"}) {
    take::FrameLogReader frames(take().frames(camera));
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
      const auto frame = frames.read_deep(pulse);
      ASSERT_TRUE(frame) << camera << " " << pulse;
      ASSERT_EQ(frame->image.format, PixelFormat::kBayerRG12);
      const std::vector<uint8_t>& bytes = frame->image.bytes;
      for (size_t pixel = 0; 2 * pixel < bytes.size(); ++pixel) {
        ASSERT_EQ(bytes[2 * pixel] & 15, pixel & 15) << camera << " " << pulse << " " << pixel;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, TwelveBitStudio,
                         testing::Values("BayerRG12", "BayerRG12p", "BayerRG12Packed"),
                         [](const auto& format) { return std::string(format.param); });

}  // namespace
}  // namespace v3d::test
