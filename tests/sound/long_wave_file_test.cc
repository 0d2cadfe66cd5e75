// A WAVE file of more than 4 GiB. The test writes 4.3 GB into the temporary folder.
#include <gtest/gtest.h>

#include <fstream>

#include "sound/wave_file.h"
#include "support/temporary_folder.h"

namespace v3d::sound {
namespace {

TEST(WaveFile, is_rf64_above_4_gib_and_read_to_its_last_sample) {
  const test::TemporaryFolder folder;
  auto writer = WaveWriter::create(folder / "a.wav", {.rate_hz = 96'000, .channels = 64}, {});
  ASSERT_TRUE(writer) << writer.error().message;
  const std::vector<int32_t> block(64 * 96'000);
  int64_t samples = 0;
  for (; samples * 64 * 3 < (int64_t{4} << 30) + 1000; samples += 96'000) {
    ASSERT_TRUE(writer->write(block));
  }
  const std::vector<int32_t> last(64, 1 << 20);
  ASSERT_TRUE(writer->write(last));
  ASSERT_TRUE(writer->finish(WaveTimecode{.rate = TimecodeRate::k24, .samples_since_midnight = 7}));
  auto reader = WaveReader::open(folder / "a.wav");
  ASSERT_TRUE(reader) << reader.error().message;
  std::string head(4, ' ');
  std::ifstream(folder / "a.wav").read(head.data(), std::ssize(head));
  EXPECT_EQ(head, "RF64");
  EXPECT_EQ(reader->samples(), samples + 1);
  EXPECT_EQ(reader->origin().samples_since_midnight, 7);
  EXPECT_EQ(reader->read(samples, 1).value(), last);
}

}  // namespace
}  // namespace v3d::sound
