#include <gtest/gtest.h>

#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "take/take_sound.h"

namespace v3d::take {
namespace {

class TakeTimecodeTest : public testing::Test {
 protected:
  std::string text_at(int64_t pulse, std::vector<SoundLedger> sounds) const {
    test::write_sounds_of_ledger(take_, std::move(sounds));
    const auto timecode = TakeTimecode(take_).at(pulse);
    return timecode ? timecode->text() : "none";
  }

  const test::TemporaryFolder folder_;
  const TakePaths take_{folder_.path()};
};

TEST_F(TakeTimecodeTest, of_a_pulse_is_that_of_its_sample) {
  // Frame 15 begins at the edge of pulse 5.
  const SoundLedger ltc = test::timecoded_sound("ltc", "25", {{1000, 10, 1000 + 90 * 1920, 100}});
  EXPECT_EQ(text_at(5, {ltc}), "00:00:00:15");
  EXPECT_EQ(text_at(20, {ltc}), "00:00:01:05");
}

TEST_F(TakeTimecodeTest, skips_the_numbers_that_drop_frame_timecode_drops) {
  const double frame = 48'000 * 1001 / 30'000.0;
  const SoundLedger ltc =
      test::timecoded_sound("ltc", "29.97df", {{1000, 1798, 1000 + 100 * frame, 1898}});
  EXPECT_EQ(text_at(0, {ltc}), "00:00:59;28");
  EXPECT_EQ(text_at(2, {ltc}), "00:01:00;02") << "80 ms later";
}

TEST_F(TakeTimecodeTest, has_jumps_where_the_recording_has_them) {
  const SoundLedger ltc = test::timecoded_sound(
      "ltc", "25", {{1000, 0, 1000 + 9 * 1920, 9}, {1000 + 10 * 1920, 500, 200'000, 590}});
  EXPECT_EQ(text_at(9, {ltc}), "00:00:00:09");
  EXPECT_EQ(text_at(10, {ltc}), "00:00:20:00");
}

TEST_F(TakeTimecodeTest, of_ltc_excludes_the_time_of_day_of_other_files) {
  const SoundLedger day =
      test::timecoded_sound("time of day", "25", {{0, 1'000'000, 200'000, 1'000'104}});
  const SoundLedger ltc = test::timecoded_sound("ltc", "25", {{1000, 10, 1000 + 9 * 1920, 19}});
  EXPECT_EQ(text_at(0, {day}), "11:06:40:00");
  EXPECT_EQ(text_at(0, {day, ltc}), "00:00:00:10");
  EXPECT_EQ(text_at(90, {day, ltc}), "none") << "the LTC ended long before";
}

TEST_F(TakeTimecodeTest, that_begins_3_s_after_the_first_pulse_is_continued_backwards) {
  const SoundLedger ltc =
      test::timecoded_sound("ltc", "25", {{1000 + 75 * 1920, 900'000, 1000 + 85 * 1920, 900'010}});
  EXPECT_EQ(text_at(75, {ltc}), "10:00:00:00");
  EXPECT_EQ(text_at(0, {ltc}), "09:59:57:00");
}

TEST_F(TakeTimecodeTest, is_not_continued_backwards_to_pulses_after_other_timecode) {
  const SoundLedger before = test::timecoded_sound("ltc", "25", {{1000, 10, 1000 + 9 * 1920, 19}});
  const SoundLedger after =
      test::timecoded_sound("ltc", "25", {{1000 + 90 * 1920, 5000, 1000 + 99 * 1920, 5009}});
  EXPECT_EQ(text_at(0, {after, before}), "00:00:00:10");
  EXPECT_EQ(text_at(50, {after, before}), "none") << "between both";
  EXPECT_EQ(text_at(90, {after, before}), "00:03:20:00");
}

TEST_F(TakeTimecodeTest, of_the_output_counts_beside_a_file_in_which_no_ltc_was_found) {
  const SoundLedger output = test::timecoded_sound("output", "25", {{1000, 10, 200'000, 113}});
  const SoundLedger silent = test::timecoded_sound("ltc", "25", {});
  EXPECT_EQ(text_at(0, {silent, output}), "00:00:00:10");
}

TEST_F(TakeTimecodeTest, of_the_output_counts_beside_ltc_without_positions_of_pulses) {
  const SoundLedger output = test::timecoded_sound("output", "25", {{1000, 10, 200'000, 113}});
  SoundLedger unmapped = test::timecoded_sound("ltc", "25", {{1000, 90, 2920, 91}});
  unmapped.map = {};
  EXPECT_EQ(text_at(0, {unmapped, output}), "00:00:00:10");
}

TEST_F(TakeTimecodeTest, is_unknown_without_sound_and_without_a_map_of_pulses) {
  EXPECT_FALSE(TakeTimecode({folder_ / "no-such-take"}).at(0));
  EXPECT_EQ(text_at(0, {}), "none");
  SoundLedger unmapped = test::timecoded_sound("ltc", "25", {{1000, 10, 2920, 11}});
  unmapped.map = {};
  EXPECT_EQ(text_at(0, {unmapped}), "none");
}

}  // namespace
}  // namespace v3d::take
