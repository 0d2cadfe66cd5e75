#include "take/ledger/sound_ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/recorded_file.h"
#include "sound/wave_file.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/take_transfer.h"

namespace v3d::take {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

SoundLedger ledger_entry() {
  return {.file = "sound/cap01.wav",
          .node = "cap01",
          .rate_hz = 48'000,
          .channels = 2,
          .samples = 4800,
          .xruns = 1,
          .lost_samples = 100,
          .gaps = {{1000, 100}},
          .map_source = "pulse channel",
          .map = {{{0, 100.5}, {2, 3940.25}}},
          .uncertainty_us = 54,
          .drift_ppm = -79.5,
          .missing_edges = 1,
          .extra_edges = 2,
          .timecode_source = "ltc",
          .timecode_rate = "25",
          .first_timecode = "10:00:00:00",
          .last_timecode = "10:00:00:02",
          .timecode_jumps = 0,
          .timecode_runs = {{.first_sample = 100.25,
                             .first_frame = 900'000,
                             .last_sample = 3940,
                             .last_frame = 900'002}}};
}

void write_sound(const TakePaths& paths, const std::string& name, int64_t samples) {
  std::filesystem::create_directories(paths.sound());
  auto writer = sound::WaveWriter::create(paths.sound() / name, {}, {});
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write(std::vector<int32_t>(static_cast<size_t>(2 * samples))));
}

/// A take of one node without cameras and with sound.
void record(const TakePaths& paths, TakeState state) {
  std::filesystem::create_directories(paths.folder);
  TakeInfo info = test::begun_take({});
  info.pulses = 3;
  info.state = state;
  test::write_text(paths.calib(), "");
  EventLogWriter pulses(paths.pulses());
  for (int64_t pulse = 0; pulse < 3; ++pulse) {
    wire::PulseMessage message;
    message.pulse = pulse;
    ASSERT_TRUE(pulses.write(message));
  }
  write_sound(paths, "cap01.wav", 4800);
  if (state == TakeState::kRecording) {
    ASSERT_TRUE(save_take_info(paths, info));
    return;
  }
  Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  ledger.sounds.push_back(ledger_entry());
  save_account_or_throw(paths, info, ledger);
}

TEST(SoundLedger, is_read_as_it_was_written) {
  const test::TemporaryFolder folder;
  Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  ledger.sounds.push_back(ledger_entry());
  ASSERT_TRUE(save_ledger(folder / "ledger.toml", ledger));
  EXPECT_THAT(load_ledger(folder / "ledger.toml").sounds, ElementsAre(ledger_entry()));
}

TEST(SoundLedger, with_a_map_that_descends_is_rejected) {
  const std::string text = "file = 'sound/a.wav'\nnode = 'a'\nmap = [[0, 10], [1, 5]]\n";
  EXPECT_THAT(test::message_of<InputError>(
                  [&] { read_sound_ledger(TomlTable::parse(text, "ledger.toml")); }),
              HasSubstr("ledger.toml:3: map: expected ascending pairs"));
}

TEST(SoundLedger, of_an_earlier_version_with_two_knots_of_one_pulse_has_the_first) {
  const std::string text =
      "file = 'sound/a.wav'\nnode = 'a'\nmap = [[0, 10], [4, 50.5], [4, 46.1], [9, 100]]\n";
  const SoundLedger sound = read_sound_ledger(TomlTable::parse(text, "ledger.toml"));
  EXPECT_EQ(sound.map, (sound::PulseMap{{{0, 10}, {4, 50.5}, {9, 100}}}));
}

TEST(SoundLedger, with_a_run_of_timecode_that_ends_before_it_begins_is_rejected) {
  const std::string text = "file = 'sound/a.wav'\nnode = 'a'\ntimecode_runs = [[10, 0, 5, 1]]\n";
  EXPECT_THAT(test::message_of<InputError>(
                  [&] { read_sound_ledger(TomlTable::parse(text, "ledger.toml")); }),
              HasSubstr("ledger.toml:3: timecode_runs: expected rows"));
}

TEST(SoundLedger, reports_xruns_as_a_problem_of_the_take) {
  Ledger ledger;
  ledger.sounds.push_back(ledger_entry());
  EXPECT_THAT(problem_lines(ledger),
              ElementsAre("sound/cap01.wav: 1 xruns, 100 samples lost, 1 pulses without an edge in "
                          "the sound"));
}

TEST(SoundLedger, reports_sound_that_begins_after_the_first_or_ends_before_the_last_pulse) {
  SoundLedger sound = ledger_entry();
  sound.xruns = sound.lost_samples = sound.missing_edges = 0;
  sound.samples = 600 * 48'000;
  sound.map = {{{0, -300 * 48'000}, {28'500, 840 * 48'000}}};
  EXPECT_EQ(
      problem_line(sound),
      "sound/cap01.wav: begins 300 s after the first pulse, ends 240 s before the last pulse");
  sound.map = {{{0, -47'000}, {28'500, 600 * 48'000 + 47'000}}};
  EXPECT_EQ(problem_line(sound), "") << "less than a second";
}

TEST(SoundLedger, reports_that_no_pulse_has_a_position) {
  SoundLedger sound = ledger_entry();
  sound.map = {};
  sound.map_source = "none";
  sound.xruns = sound.missing_edges = 0;
  EXPECT_EQ(problem_line(sound), "sound/cap01.wav: no pulse has a position in the sound");
}

TEST(SoundOfATake, is_verified_against_the_ledger) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kComplete);
  EXPECT_THAT(verify_take(paths).disagreements, IsEmpty());
  EXPECT_THAT(verify_take(paths).ledger.sounds, ElementsAre(ledger_entry()));
}

TEST(SoundOfATake, with_other_samples_than_the_ledger_disagrees) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kComplete);
  std::filesystem::remove(paths.sound() / "cap01.wav");
  write_sound(paths, "cap01.wav", 4700);
  EXPECT_THAT(
      verify_take(paths).disagreements,
      Contains("sound/cap01.wav: holds 4,700 samples of 2 channels at 48,000 Hz, the ledger "
               "says 4,800 samples of 2 channels at 48,000 Hz"));
}

TEST(SoundOfATake, that_is_missing_or_not_in_the_ledger_disagrees) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kComplete);
  std::filesystem::rename(paths.sound() / "cap01.wav", paths.sound() / "cap02.wav");
  const auto disagreements = verify_take(paths).disagreements;
  EXPECT_THAT(disagreements, Contains(HasSubstr("sound/cap01.wav: missing")));
  EXPECT_THAT(disagreements, Contains(HasSubstr("sound/cap02.wav: is not named in the ledger")));
}

/// Nodes without sound, by a verification of a take with these cameras. All three nodes of its
/// studio have a sound device; cap01 has the trigger.
std::vector<std::string> nodes_without_sound(const TakePaths& paths,
                                             const std::vector<std::string>& cameras) {
  std::string studio =
      test::studio_text({{"cap01", {"cam01"}}, {"cap02", {"cam02"}}, {"cap03", {"cam03"}}});
  for (const std::string node : {"cap01", "cap02", "cap03"}) {
    studio += "[[sound]]\nnode = '" + node + "'\ndevice = 'hw:1'\n";
  }
  test::write_text(paths.studio(), studio);
  TakeInfo info = load_take_info(paths);
  info.cameras = cameras;
  EXPECT_TRUE(save_take_info(paths, info));
  const Ledger ledger = verify_take(paths).ledger;
  for (const std::string& node : ledger.nodes_without_sound) {
    EXPECT_THAT(problem_lines(ledger), Contains("sound of " + node + ": nothing was recorded"));
  }
  return ledger.nodes_without_sound;
}

TEST(SoundOfATake, of_which_a_device_has_delivered_nothing_is_reported) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kComplete);
  EXPECT_THAT(nodes_without_sound(paths, {"cam01"}), IsEmpty()) << "the other parts are not here";
  EXPECT_THAT(nodes_without_sound(paths, {"cam01", "cam02"}), ElementsAre("cap02"));
}

TEST(SoundOfATake, of_which_the_node_of_the_trigger_has_recorded_nothing_is_reported) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kComplete);
  Ledger ledger = load_ledger(paths.ledger());
  ledger.sounds.clear();
  ASSERT_TRUE(save_ledger(paths.ledger(), ledger));
  EXPECT_THAT(nodes_without_sound(paths, {}), IsEmpty()) << "it has a file";
  std::filesystem::remove(paths.sound() / "cap01.wav");
  EXPECT_THAT(nodes_without_sound(paths, {}), ElementsAre("cap01"));
}

TEST(SoundOfATake, is_counted_by_a_recovery) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kRecording);
  write_sound(paths, "cap01.0001.wav", 480);
  const Verification recovered = recover_take(paths);
  ASSERT_EQ(recovered.ledger.sounds.size(), 2U);
  EXPECT_EQ(recovered.ledger.sounds[0].file, "sound/cap01.0001.wav");
  EXPECT_EQ(recovered.ledger.sounds[0].node, "cap01");
  EXPECT_EQ(recovered.ledger.sounds[0].samples, 480);
  EXPECT_EQ(recovered.ledger.sounds[1].samples, 4800);
  EXPECT_FALSE(recovered.ledger.sounds[1].map.is_known());
  EXPECT_THAT(verify_take(paths).disagreements, IsEmpty());
}

TEST(SoundOfATake, is_joined_from_all_nodes) {
  const test::TemporaryFolder folder;
  for (const std::string node : {"cap01", "cap02"}) {
    const TakePaths part{folder / node};
    record(part, TakeState::kComplete);
    std::filesystem::rename(part.sound() / "cap01.wav", part.sound() / (node + ".wav"));
    Ledger ledger = load_ledger(part.ledger());
    ledger.sounds[0].file = "sound/" + node + ".wav";
    ledger.sounds[0].node = node;
    ledger.files.clear();
    save_account_or_throw(part, load_take_info(part), ledger);
  }
  const TakePaths into{folder / "joined"};
  join_parts({{folder / "cap01"}, {folder / "cap02"}}, into);
  const Verification joined = verify_take(into);
  EXPECT_THAT(joined.disagreements, IsEmpty());
  EXPECT_EQ(joined.ledger.sounds.size(), 2U);
}

TEST(SoundOfATake, is_a_recorded_file_that_no_result_replaces) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  record(paths, TakeState::kComplete);
  EXPECT_TRUE(is_recorded_file(paths.sound() / "cap01.wav"));
}

TEST(SoundOfATake, continues_in_the_next_file_of_its_node) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder / "kendo-07"};
  std::filesystem::create_directories(paths.sound());
  EXPECT_EQ(next_sound_file(paths, "cap01").value(), paths.sound() / "cap01.wav");
  record(paths, TakeState::kComplete);
  EXPECT_EQ(next_sound_file(paths, "cap01").value(), paths.sound() / "cap01.0001.wav");
  EXPECT_EQ(next_sound_file(paths, "cap02").value(), paths.sound() / "cap02.wav");
}

}  // namespace
}  // namespace v3d::take
