#include "sound/wave_timecode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "sound/wave_file.h"
#include "support/temporary_folder.h"

namespace v3d::sound {
namespace {

using testing::HasSubstr;
using testing::Optional;

constexpr int kRate = 48'000;
const RealtimeInstant kFirstSample = from_ns<Realtime>(1'795'864'000'250'000'001);

std::vector<uint8_t> bytes_of(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  return {text.begin(), text.end()};
}

/// A file of 100 samples while it is recorded, and after its end.
class TimecodedWave : public testing::Test {
 protected:
  TimecodedWave() {
    auto writer = WaveWriter::create(path_, {.rate_hz = kRate, .channels = 2},
                                     wave_origin(kFirstSample, kRate, "take a", "V3D"));
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->write(std::vector<int32_t>(200, 256)));
    recorded_ = bytes_of(path_);
    status_ = writer->finish(timecode_);
    finished_ = bytes_of(path_);
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "cap01.wav";
  const WaveTimecode timecode_{.rate = TimecodeRate::k2997Drop,
                               .samples_since_midnight = (int64_t{3} << 32) + 5};
  std::vector<uint8_t> recorded_, finished_;
  io::Status status_;
};

TEST_F(TimecodedWave, has_its_timecode_as_time_reference_after_its_end) {
  ASSERT_TRUE(status_) << status_.error().message;
  auto reader = WaveReader::parse(finished_, path_);
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_EQ(reader->origin().samples_since_midnight, timecode_.samples_since_midnight);
  EXPECT_THAT(reader->origin().timecode_rate, Optional(TimecodeRate::k2997Drop));
  EXPECT_EQ(first_sample_time(reader->origin(), kRate), kFirstSample) << "the wall clock";
  EXPECT_EQ(reader->read(0, 200).value(), std::vector<int32_t>(200, 256));
}

TEST_F(TimecodedWave, has_local_time_as_time_reference_while_it_is_recorded) {
  auto reader = WaveReader::parse(recorded_, path_);
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_EQ(reader->origin(), wave_origin(kFirstSample, kRate, "take a", "V3D"));
  EXPECT_EQ(reader->origin().timecode_rate, std::nullopt);
  EXPECT_EQ(reader->samples(), 100);
}

TEST_F(TimecodedWave, changes_in_one_page_of_its_header_and_keeps_its_length) {
  ASSERT_EQ(finished_.size(), recorded_.size());
  size_t last_change = 0;
  for (size_t i = 0; i < finished_.size(); ++i) {
    if (finished_[i] != recorded_[i]) last_change = i;
  }
  EXPECT_GT(last_change, 0U);
  EXPECT_LT(last_change, 4096U) << "a kill leaves the old header or the new one";
}

TEST_F(TimecodedWave, is_readable_with_its_wall_clock_where_the_header_changed_in_part) {
  for (size_t changed = 0; changed < 4096 && changed < finished_.size(); changed += 128) {
    std::vector<uint8_t> bytes = recorded_;
    std::copy_n(finished_.begin(), changed, bytes.begin());
    auto reader = WaveReader::parse(bytes, path_);
    ASSERT_TRUE(reader) << reader.error().message;
    EXPECT_EQ(reader->samples(), 100);
    EXPECT_EQ(first_sample_time(reader->origin(), kRate), kFirstSample) << changed;
  }
}

TEST(WaveMetadata, are_the_elements_of_ixml) {
  const std::string text = write_metadata({.rate_hz = 96'000,
                                           .samples_since_midnight = (int64_t{1} << 32) + 7,
                                           .timecode_rate = TimecodeRate::k2997Drop,
                                           .first_sample = kFirstSample});
  EXPECT_EQ(text.size(), kMetadataBytes);
  for (const char* expected :
       {"<TIMECODE_RATE>30000/1001</TIMECODE_RATE>", "<TIMECODE_FLAG>DF</TIMECODE_FLAG>",
        "<FILE_SAMPLE_RATE>96000</FILE_SAMPLE_RATE>",
        "<TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_HI>1</TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_HI>",
        "<TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_LO>7</TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_LO>"}) {
    EXPECT_THAT(text, HasSubstr(expected));
  }
}

TEST(WaveMetadata, are_read_as_they_were_written_at_every_rate) {
  for (const TimecodeRate rate : kTimecodeRates) {
    const auto read =
        read_metadata(write_metadata({.timecode_rate = rate, .first_sample = kFirstSample}));
    EXPECT_THAT(read.timecode_rate, Optional(rate));
    EXPECT_EQ(read.first_sample, kFirstSample);
  }
  const auto without = read_metadata(write_metadata({}));
  EXPECT_EQ(without.timecode_rate, std::nullopt);
  EXPECT_EQ(without.first_sample, std::nullopt);
}

RC_GTEST_PROP(WaveMetadataProperty, of_any_text_are_read_or_empty, (const std::string& text)) {
  read_metadata(text);
  read_metadata("<TIMECODE_RATE>" + text);
  const auto read = read_metadata("<FIRST_SAMPLE_UTC_NS>" + text + "</FIRST_SAMPLE_UTC_NS>");
  if (read.first_sample) RC_ASSERT(std::to_string(to_ns(*read.first_sample)).size() <= text.size());
}

/// A run from `first` at the sample `begin` on, for ten seconds.
TimecodeRun run_from(const Timecode& first, TimecodeRate rate, double begin) {
  const double pitch = kRate / frames_per_second(rate);
  const int64_t number = frame_number(first, rate);
  const int64_t frames = std::llround(10 * frames_per_second(rate));
  return {begin, number, begin + static_cast<double>(frames) * pitch, number + frames};
}

TEST(FirstTimecode, is_that_of_the_first_sample_at_every_rate) {
  for (const TimecodeRate rate : kTimecodeRates) {
    const std::vector<TimecodeRun> runs = {run_from({10, 0, 0, 0}, rate, 0)};
    const auto first = first_timecode(runs, rate, kRate);
    ASSERT_TRUE(first);
    const double seconds =
        static_cast<double>(frame_number({10, 0, 0, 0}, rate)) / frames_per_second(rate);
    EXPECT_EQ(first->samples_since_midnight, std::llround(seconds * kRate));
    EXPECT_EQ(first->text(kRate), timecode_text({10, 0, 0, 0}, rate));
  }
  EXPECT_EQ(first_timecode(std::vector{run_from({1, 0, 0, 0}, TimecodeRate::k2997, 0)},
                           TimecodeRate::k2997, kRate)
                ->samples_since_midnight,
            std::llround(3603.6 * kRate));
}

TEST(FirstTimecode, is_continued_backwards_where_the_timecode_begins_later) {
  const std::vector<TimecodeRun> runs = {run_from({0, 0, 10, 0}, TimecodeRate::k25, 30 * kRate)};
  const auto first = first_timecode(runs, TimecodeRate::k25, kRate);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->samples_since_midnight, (24 * 3600 - 20) * int64_t{kRate}) << "before midnight";
  EXPECT_EQ(first->text(kRate), "23:59:40:00");
  EXPECT_EQ(first_timecode({}, TimecodeRate::k25, kRate), std::nullopt);
}

}  // namespace
}  // namespace v3d::sound
