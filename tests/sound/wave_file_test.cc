#include "sound/wave_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/io/file.h"
#include "support/file_size_limit.h"
#include "support/temporary_folder.h"

namespace v3d::sound {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

constexpr WaveFormat kStereo{.rate_hz = 48'000, .channels = 2};
const WaveOrigin kOrigin{.description = "take kendo-07, node cap01",
                         .originator = "V3D",
                         .date = "2026-11-27",
                         .time = "15:04:05",
                         .samples_since_midnight = 4'294'967'296LL + 7};

std::vector<int32_t> ramp(size_t values) {
  std::vector<int32_t> ramp(values);
  for (size_t i = 0; i < values; ++i) ramp[i] = (static_cast<int32_t>(i) - 500) * 256;
  return ramp;
}

void write_wave(const std::filesystem::path& path, const std::vector<int32_t>& values) {
  auto writer = WaveWriter::create(path, kStereo, kOrigin);
  ASSERT_TRUE(writer) << writer.error().message;
  ASSERT_TRUE(writer->write(values));
}

std::vector<uint8_t> bytes_of(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  return {text.begin(), text.end()};
}

TEST(WaveFile, holds_the_samples_the_format_and_the_origin_that_were_written) {
  const test::TemporaryFolder folder;
  const std::vector<int32_t> values = ramp(2000);
  write_wave(folder / "cap01.wav", values);
  auto reader = WaveReader::open(folder / "cap01.wav");
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_EQ(reader->format(), kStereo);
  EXPECT_EQ(reader->origin(), kOrigin);
  EXPECT_EQ(reader->samples(), 1000);
  EXPECT_EQ(reader->read(0, 1000).value(), values);
}

TEST(WaveFile, keeps_the_upper_24_bits_of_a_value) {
  const test::TemporaryFolder folder;
  write_wave(folder / "cap01.wav", {0x12345678, -1, INT32_MIN, INT32_MAX});
  auto reader = WaveReader::open(folder / "cap01.wav");
  EXPECT_THAT(reader->read(0, 2).value(),
              testing::ElementsAre(0x12345600, -256, INT32_MIN, 0x7FFFFF00));
}

TEST(WaveFile, is_read_from_any_sample_up_to_its_end) {
  const test::TemporaryFolder folder;
  const std::vector<int32_t> values = ramp(2000);
  write_wave(folder / "cap01.wav", values);
  auto reader = WaveReader::open(folder / "cap01.wav");
  EXPECT_EQ(reader->read(990, 100).value(), std::vector(values.end() - 20, values.end()));
  EXPECT_THAT(reader->read(1000, 1).value(), SizeIs(0));
  EXPECT_THAT(reader->read(INT64_MAX, INT64_MAX).value(), SizeIs(0));
  EXPECT_THAT(reader->read(-5, 1).value(), SizeIs(2));
}

TEST(WaveFile, is_plain_riff_below_4_gib) {
  const test::TemporaryFolder folder;
  write_wave(folder / "cap01.wav", ramp(2000));
  EXPECT_EQ(read_file(folder / "cap01.wav").substr(0, 4), "RIFF");
}

TEST(WaveFile, never_replaces_a_file) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "cap01.wav", "footage");
  const auto writer = WaveWriter::create(folder / "cap01.wav", kStereo, kOrigin);
  ASSERT_FALSE(writer);
  EXPECT_THAT(writer.error().message, HasSubstr("cap01.wav"));
  EXPECT_EQ(read_file(folder / "cap01.wav"), "footage");
}

TEST(WaveFile, reports_a_disk_that_takes_no_more_and_keeps_the_earlier_samples) {
  const test::TemporaryFolder folder;
  const std::vector<int32_t> values = ramp(2000);
  auto writer = WaveWriter::create(folder / "cap01.wav", kStereo, kOrigin);
  ASSERT_TRUE(writer->write(values));
  {
    const test::FileSizeLimit limit(8192);
    const auto status = writer->write(values);
    ASSERT_FALSE(status);
    EXPECT_THAT(status.error().message, HasSubstr("cap01.wav: File too large"));
  }
  EXPECT_FALSE(writer->write(values)) << "a file with a gap would have wrong times";
  auto reader = WaveReader::open(folder / "cap01.wav");
  ASSERT_TRUE(reader) << reader.error().message;
  ASSERT_GE(reader->samples(), 1000);
  EXPECT_EQ(reader->read(0, 1000).value(), values);
}

TEST(WaveFile, that_was_cut_ends_at_its_last_whole_sample) {
  const test::TemporaryFolder folder;
  const std::vector<int32_t> values = ramp(2000);
  write_wave(folder / "cap01.wav", values);
  std::vector<uint8_t> bytes = bytes_of(folder / "cap01.wav");
  bytes.resize(bytes.size() - 6 * 100 - 1);
  auto reader = WaveReader::parse(bytes, "cap01.wav");
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_EQ(reader->samples(), 899);
  EXPECT_EQ(reader->read(0, 1000).value(), std::vector(values.begin(), values.begin() + 1798));
}

TEST(WaveFile, of_another_kind_is_rejected_with_the_expected_kind) {
  for (const std::string text : {"", "RIFF", "fLaC0000WAVE", "RIFF0000AVI "}) {
    const auto reader = WaveReader::parse({text.begin(), text.end()}, "a/b.wav");
    ASSERT_FALSE(reader);
    EXPECT_EQ(reader.error().message,
              "cannot read a/b.wav: it is not a sound file; expected a WAV or RF64 file of PCM");
  }
}

RC_GTEST_PROP(WaveFileProperty, is_read_or_rejected_after_any_damage, ()) {
  const test::TemporaryFolder folder;
  write_wave(folder / "a.wav", ramp(20));
  std::vector<uint8_t> bytes = bytes_of(folder / "a.wav");
  const auto changes = *rc::gen::container<std::vector<std::pair<uint16_t, uint8_t>>>(
      rc::gen::arbitrary<std::pair<uint16_t, uint8_t>>());
  for (const auto& [at, value] : changes) bytes[at % bytes.size()] = value;
  auto reader = WaveReader::parse(bytes, "a.wav");
  if (!reader) return;
  const auto values = reader->read(0, 100);
  if (values) RC_ASSERT(values->size() <= 100U * static_cast<size_t>(reader->format().channels));
}

TEST(WaveOrigin, counts_samples_since_local_midnight) {
  setenv("TZ", "UTC-2", 1);
  tzset();
  const auto at = from_ns<Realtime>((1'790'000'000LL * 1'000'000'000) + 500'000'000);
  const WaveOrigin origin = wave_origin(at, 48'000, "d", "o");
  const auto read = first_sample_time(origin, 48'000);
  unsetenv("TZ");
  tzset();
  EXPECT_EQ(read, at);
  EXPECT_EQ(origin.date, "2026-09-21");
  EXPECT_EQ(origin.time, "16:13:20");
  EXPECT_EQ(origin.samples_since_midnight, ((16 * 60 + 13) * 60 + 20) * 48'000LL + 24'000);
}

TEST(WaveOrigin, without_a_date_gives_no_time) {
  for (const char* date : {"", "yesterday", "2026-09-21x", "2026-13-01"}) {
    const WaveOrigin origin{"", "", date, "", 0};
    EXPECT_EQ(first_sample_time(origin, 48'000), std::nullopt) << date;
  }
  const WaveOrigin late{"", "", "2026-09-21", "", 86'400LL * 48'000};
  EXPECT_EQ(first_sample_time(late, 48'000), std::nullopt);
}

}  // namespace
}  // namespace v3d::sound
