#include "take/ledger/ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::take {
namespace {

using Numbers = std::vector<int64_t>;

Ledger whole_ledger() {
  Ledger ledger{.take = "kendo-07", .commanded = 1250, .sensed = 1250, .cameras = {}};
  Numbers pulses(1250);
  std::iota(pulses.begin(), pulses.end(), 0);
  for (int i = 0; i < 15; ++i) {
    ledger.cameras.push_back(account("cam" + std::to_string(i), pulses, {}, 1250));
  }
  return ledger;
}

TEST(Ledger, is_complete_when_every_camera_has_every_pulse_once) {
  EXPECT_TRUE(whole_ledger().complete());
  EXPECT_EQ(whole_ledger().verdict(),
            "take kendo-07: complete, 15 cameras x 1,250 pulses, 0 missing, 0 suspect");
}

TEST(Ledger, is_incomplete_with_any_defect) {
  const auto complete_after = [](auto change) {
    Ledger ledger = whole_ledger();
    change(ledger);
    return ledger.complete();
  };
  EXPECT_FALSE(complete_after([](Ledger& l) { l.cameras[3].missing = {7}; }));
  EXPECT_FALSE(complete_after([](Ledger& l) { l.cameras[3].duplicate = {7}; }));
  EXPECT_FALSE(complete_after([](Ledger& l) { l.cameras[3].suspect = {7}; }));
  EXPECT_FALSE(complete_after([](Ledger& l) { l.cameras[3].written -= 1; }));
  EXPECT_FALSE(complete_after([](Ledger& l) { *l.sensed -= 1; }));
  EXPECT_FALSE(complete_after([](Ledger& l) { l.cameras.clear(); }));
}

TEST(Ledger, lists_missing_duplicate_and_suspect_pulses) {
  const CameraLedger camera = account("cam07", {0, 1, 4, 4, 2}, {1}, 6);
  EXPECT_EQ(camera.missing, (Numbers{3, 5}));
  EXPECT_EQ(camera.duplicate, (Numbers{4}));
  EXPECT_EQ(camera.suspect, (Numbers{1}));
  EXPECT_EQ(camera.written, 5);
}

TEST(Ledger, marks_frames_outside_the_commanded_pulses_as_suspect) {
  EXPECT_EQ(account("cam07", {0, 1, 2, -1}, {}, 2).suspect, (Numbers{-1, 2}));
}

RC_GTEST_PROP(Ledger, accounts_for_every_pulse, ()) {
  const auto commanded = *rc::gen::inRange<int64_t>(0, 50);
  const auto pulses = *rc::gen::container<Numbers>(rc::gen::inRange<int64_t>(0, commanded + 1));
  const CameraLedger camera = account("cam07", pulses, {}, commanded);
  for (int64_t pulse = 0; pulse < commanded; ++pulse) {
    const auto frames = std::count(pulses.begin(), pulses.end(), pulse);
    const auto named = [&](const Numbers& list) {
      return std::count(list.begin(), list.end(), pulse);
    };
    RC_ASSERT(named(camera.missing) == (frames == 0));
    RC_ASSERT(named(camera.duplicate) == (frames > 1));
  }
}

TEST(Ledger, is_unchanged_after_saving_and_loading) {
  const test::TemporaryFolder folder;
  Ledger ledger = whole_ledger();
  ledger.cameras[2] = account("cam2", {0, 1, 1, 5}, {5}, 7);
  ledger.cameras[2].published = 3;
  EXPECT_TRUE(save_ledger(folder / "ledger.toml", ledger));
  const Ledger back = load_ledger(folder / "ledger.toml");
  EXPECT_EQ(back.verdict(), ledger.verdict());
  EXPECT_EQ(back.cameras[2].name, "cam2");
  EXPECT_EQ(back.cameras[2].exposed, 4);
  EXPECT_EQ(back.cameras[2].received, 4);
  EXPECT_EQ(back.cameras[2].published, 3);
  EXPECT_EQ(back.cameras[2].missing, ledger.cameras[2].missing);
  EXPECT_EQ(back.cameras[2].duplicate, ledger.cameras[2].duplicate);
  EXPECT_EQ(back.cameras[2].suspect, ledger.cameras[2].suspect);
}

/// The text of a small ledger that uses every field.
std::string ledger_text(const std::filesystem::path& path) {
  Ledger ledger = whole_ledger();
  ledger.cameras.resize(2);
  ledger.cameras[1] = account("cam1", {0, 1, 1, 5}, {5}, 7);
  ledger.files = {
      {.name = "calib.toml", .bytes = 700, .changed_ns = 0, .checksum = 0x123456789ABCDEF0},
      {.name = "cam1.lcmlog", .bytes = 9, .changed_ns = 0, .checksum = {}}};
  EXPECT_TRUE(save_ledger(path, ledger));
  return read_file(path);
}

/// The ledger of `cameras` cameras, each of which misses `missing`.
Ledger ledger_with_missing(int cameras, const Numbers& missing) {
  Ledger ledger{.take = "kendo-07", .commanded = 90'000, .sensed = 90'000, .cameras = {}};
  for (int i = 0; i < cameras; ++i) {
    ledger.cameras.push_back(account("cam" + std::to_string(i), {}, {}, 0));
    ledger.cameras.back().missing = missing;
  }
  return ledger;
}

TEST(Ledger, of_an_hour_in_which_cameras_ignored_every_second_trigger_is_read_again) {
  Numbers missing;
  for (int64_t pulse = 1; pulse < 90'000; pulse += 2) missing.push_back(pulse);
  const Ledger ledger = ledger_with_missing(32, missing);
  const test::TemporaryFolder folder;
  ASSERT_TRUE(save_ledger(folder / "ledger.toml", ledger));
  EXPECT_EQ(load_ledger(folder / "ledger.toml").cameras, ledger.cameras);
}

TEST(Ledger, has_the_pulses_of_hours_without_a_node_in_a_few_lines) {
  Numbers missing(150'000);
  std::iota(missing.begin(), missing.end(), 30'000);
  missing.insert(missing.begin(), -7);
  Ledger ledger = ledger_with_missing(16, missing);
  ledger.unsensed = ledger.runt = missing;
  const test::TemporaryFolder folder;
  ASSERT_TRUE(save_ledger(folder / "ledger.toml", ledger));
  EXPECT_LT(std::filesystem::file_size(folder / "ledger.toml"), 4096U);
  const Ledger loaded = load_ledger(folder / "ledger.toml");
  EXPECT_EQ(loaded.cameras, ledger.cameras);
  EXPECT_EQ(loaded.unsensed, missing);
  EXPECT_EQ(loaded.runt, missing);
}

TEST(Ledger, of_a_day_in_which_cameras_had_half_the_rate_has_a_few_lines) {
  constexpr int64_t kDay = 5'000'000;
  Numbers missing;
  for (int64_t pulse = 1; pulse < kDay; pulse += 2) {
    if (pulse % 1'000'001 == 0) --pulse;  // the camera started again
    missing.push_back(pulse);
  }
  const Ledger ledger = ledger_with_missing(3, missing);
  const test::TemporaryFolder folder;
  ASSERT_TRUE(save_ledger(folder / "ledger.toml", ledger));
  EXPECT_LT(std::filesystem::file_size(folder / "ledger.toml"), 4096U);
  EXPECT_EQ(load_ledger(folder / "ledger.toml").cameras, ledger.cameras);
}

RC_GTEST_PROP(Ledger, has_the_same_long_lists_after_saving_and_loading, ()) {
  const auto step = rc::gen::element<int64_t>(1, 1, 2, 3, 7);
  const auto length = *rc::gen::inRange<size_t>(0, 2500);
  Numbers numbers{*rc::gen::inRange<int64_t>(-9, 9)};
  while (numbers.size() < length) {
    const int64_t difference = *step;
    const auto run = *rc::gen::inRange<size_t>(1, 300);
    for (size_t i = 0; i < run; ++i) numbers.push_back(numbers.back() + difference);
  }
  const test::TemporaryFolder folder;
  const Ledger ledger = ledger_with_missing(1, numbers);
  RC_ASSERT(save_ledger(folder / "ledger.toml", ledger).has_value());
  RC_ASSERT(load_ledger(folder / "ledger.toml").cameras == ledger.cameras);
}

TEST(Ledger, that_no_program_could_read_replaces_none) {
  const test::TemporaryFolder folder;
  ASSERT_TRUE(save_ledger(folder / "ledger.toml", whole_ledger()));
  Numbers irregular;
  uint32_t noise = 1;
  for (int64_t pulse = 5'000'000; irregular.size() < 1'000'000; pulse += 1 + (noise >> 16) % 3) {
    irregular.push_back(pulse);
    noise = noise * 1664525 + 1013904223;
  }
  const io::Status saved = save_ledger(folder / "ledger.toml", ledger_with_missing(8, irregular));
  ASSERT_FALSE(saved);
  EXPECT_EQ(saved.error().code, EFBIG);
  EXPECT_THAT(saved.error().message, testing::HasSubstr("bytes; expected at most 67,108,864"));
  EXPECT_EQ(load_ledger(folder / "ledger.toml").verdict(), whole_ledger().verdict());
}

TEST(Ledger, lists_every_pulse_of_a_node_that_left_a_take_of_hours_when_it_is_merged) {
  Ledger first{.take = "kendo-07", .commanded = 1'000'002, .sensed = 1'000'002, .cameras = {}};
  Ledger second{.take = "kendo-07", .commanded = 1, .sensed = std::nullopt, .cameras = {}};
  second.cameras.push_back(account("cam02", {0}, {}, 1));
  const Ledger whole = merge({first, second});
  ASSERT_EQ(whole.cameras.front().missing.size(), 1'000'001U);
  EXPECT_EQ(whole.cameras.front().missing.front(), 1);
  EXPECT_EQ(whole.cameras.front().missing.back(), 1'000'001);
}

TEST(Ledger, rejects_steps_that_are_no_triples_or_do_not_meet_the_last_number) {
  const std::string before = "take = 'a'\ncommanded = 3\nsensed = 0\nunsensed_steps = ";
  for (const char* steps : {"[1, 2]", "[2, 1, 1]", "[1, 3, 0]", "[1, 3, -1]", "[1, 4, 2]",
                            "[0, 10000000, 1]", "[-9223372036854775808, 9223372036854775807, 1]"}) {
    EXPECT_THROW(parse_ledger(before + steps + "\n", "ledger.toml"), InputError) << steps;
  }
  EXPECT_EQ(parse_ledger(before + "[1, 5, 2, 8, 8, 1]\n", "ledger.toml").unsensed,
            (Numbers{1, 3, 5, 8}));
}

TEST(Ledger, rejects_runs_that_are_no_pairs_descend_or_are_longer_than_any_take) {
  const std::string before = "take = 'a'\ncommanded = 3\nsensed = 0\nunsensed_runs = ";
  for (const char* runs : {"[1]", "[2, 1]", "[0, 9223372036854775807]",
                           "[-9223372036854775808, 9223372036854775807]", "[0, 10000000]"}) {
    EXPECT_THROW(parse_ledger(before + runs + "\n", "ledger.toml"), InputError) << runs;
  }
  EXPECT_EQ(parse_ledger(before + "[1, 2, 4, 4]\n", "ledger.toml").unsensed, (Numbers{1, 2, 4}));
}

TEST(Ledger, is_rejected_with_any_flipped_bit) {
  const test::TemporaryFolder folder;
  std::string text = ledger_text(folder / "ledger.toml");
  ASSERT_NO_THROW(parse_ledger(text, "ledger.toml"));
  for (size_t bit = 0; bit < 8 * text.size(); ++bit) {
    text[bit / 8] ^= static_cast<char>(1 << bit % 8);
    EXPECT_THROW(parse_ledger(text, "ledger.toml"), InputError) << "bit " << bit << "\n" << text;
    text[bit / 8] ^= static_cast<char>(1 << bit % 8);
  }
}

TEST(Ledger, is_rejected_when_it_is_truncated) {
  const test::TemporaryFolder folder;
  const std::string text = ledger_text(folder / "ledger.toml");
  for (size_t size = 0; size < text.size(); ++size) {
    EXPECT_THROW(parse_ledger(text.substr(0, size), "ledger.toml"), InputError) << size;
  }
}

TEST(Ledger, accepts_an_older_version_without_a_checksum) {
  const test::TemporaryFolder folder;
  const std::string text = ledger_text(folder / "ledger.toml");
  const Ledger old = parse_ledger(text.substr(text.find("take = ")), "ledger.toml");
  EXPECT_EQ(old.verdict(), load_ledger(folder / "ledger.toml").verdict());
  EXPECT_EQ(old.files.size(), 2U);
}

TEST(Ledger, keeps_recorded_frames_of_uncounted_pulses_as_suspect_when_merged) {
  Ledger first{.take = "kendo-07", .commanded = 4, .sensed = 4, .cameras = {}};
  first.cameras.push_back(account("cam01", {0, 1, 2, 3}, {}, 4));
  Ledger second{.take = "kendo-07", .commanded = 2, .sensed = std::nullopt, .cameras = {}};
  second.cameras.push_back(account("cam02", {0, 1, 2}, {}, 2));
  const Ledger whole = merge({first, second});
  EXPECT_EQ(whole.cameras[1].missing, std::vector<int64_t>{3});
  EXPECT_EQ(whole.cameras[1].suspect, std::vector<int64_t>{2});
}

TEST(Ledger, merges_the_cameras_of_all_nodes_and_the_pulses_of_the_node_with_the_most) {
  Ledger first{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  first.cameras.push_back(account("cam01", {0, 1, 2}, {}, 3));
  Ledger second{.take = "kendo-07", .commanded = 2, .sensed = std::nullopt, .cameras = {}};
  second.cameras.push_back(account("cam02", {0, 1}, {}, 2));
  for (const auto& parts : {std::vector{first, second}, std::vector{second, first}}) {
    const Ledger whole = merge(parts);
    EXPECT_EQ(whole.commanded, 3);
    EXPECT_EQ(whole.sensed, 3);
    ASSERT_EQ(whole.cameras.size(), 2U);
    EXPECT_FALSE(whole.complete());
    EXPECT_THAT(problem_lines(whole), testing::ElementsAre("cam02: missing pulses 2"));
  }
}

TEST(Ledger, keeps_extra_and_runt_pulses_when_a_node_without_the_sense_line_has_as_many_pulses) {
  Ledger trigger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  trigger.cameras.push_back(account("cam01", {0, 1, 2}, {}, 3));
  Ledger other = trigger;
  other.cameras.front().name = "cam02";
  trigger.extra = 2;
  trigger.runt = {1};
  for (const auto& parts : {std::vector{trigger, other}, std::vector{other, trigger}}) {
    const Ledger whole = merge(parts);
    EXPECT_EQ(whole.extra, 2);
    EXPECT_EQ(whole.runt, Numbers{1});
    EXPECT_FALSE(whole.complete());
  }
}

/// The ledger of a node. Only the node with the sense line has unsensed, extra and runt pulses.
Ledger any_ledger(bool has_sense_line, int64_t max_pulses) {
  const auto pulse = rc::gen::inRange<int64_t>(0, max_pulses);
  Ledger ledger{.take = "kendo-07", .commanded = *pulse, .sensed = {}, .cameras = {}};
  if (*rc::gen::arbitrary<bool>()) ledger.sensed = *pulse;
  if (!has_sense_line) return ledger;
  ledger.sensed = *pulse;
  ledger.extra = *pulse;
  for (int64_t n = 0; n < max_pulses; ++n) {
    if (*rc::gen::arbitrary<bool>()) ledger.runt.push_back(n);
    if (*rc::gen::arbitrary<bool>()) ledger.unsensed.push_back(n);
  }
  return ledger;
}

RC_GTEST_PROP(Ledger, has_the_same_pulses_in_whatever_order_the_nodes_are_merged, ()) {
  std::vector<Ledger> parts{any_ledger(true, 4)};
  const int others = *rc::gen::inRange(0, 4);
  for (int i = 0; i < others; ++i) parts.push_back(any_ledger(false, 4));
  const Ledger whole = merge(parts);
  RC_ASSERT(whole.extra == parts.front().extra);
  RC_ASSERT(whole.runt == parts.front().runt);
  std::rotate(parts.begin(), parts.begin() + *rc::gen::inRange(0, others + 1), parts.end());
  const Ledger rotated = merge(parts);
  RC_ASSERT(rotated.verdict() == whole.verdict());
  RC_ASSERT(rotated.unsensed == whole.unsensed);
}

TEST(Ledger, lists_problems_by_camera_with_pulse_ranges) {
  Ledger ledger = whole_ledger();
  EXPECT_TRUE(problem_lines(ledger).empty());
  ledger.cameras[3].missing = {3, 4, 5, 9};
  ledger.cameras[7].suspect = {-1, 12};
  EXPECT_THAT(problem_lines(ledger),
              testing::ElementsAre("cam3: missing pulses 3-5, 9", "cam7: suspect pulses -1, 12"));
}

TEST(Ledger, lists_regular_pulses_as_ranges_with_their_difference) {
  EXPECT_EQ(number_ranges({1, 3, 5, 9}), "1, 3, 5, 9");
  EXPECT_EQ(number_ranges({0, 2, 4, 6, 8, 9, 10, 40}), "0-8 by 2, 9-10, 40");
  constexpr int64_t kMin = std::numeric_limits<int64_t>::min();
  EXPECT_EQ(number_ranges({kMin, -1, 0}), std::to_string(kMin) + ", -1-0");
}

/// A camera at half the rate, and one that lost frames without any regularity, for an hour at 60
/// Hz.
TEST(Ledger, lists_problems_of_hours_in_short_lines) {
  Ledger ledger = whole_ledger();
  for (int64_t pulse = 0; pulse < 216'000; pulse += 2) ledger.cameras[3].missing.push_back(pulse);
  for (int64_t pulse = 0; pulse < 216'000; pulse += 1 + pulse % 3 + pulse % 7) {
    ledger.cameras[4].missing.push_back(pulse);
  }
  const std::vector<std::string> lines = problem_lines(ledger);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0], "cam3: missing pulses 0-215998 by 2");
  EXPECT_LT(lines[1].size(), 1000U);
  EXPECT_THAT(lines[1],
              testing::EndsWith(", ... (" + format_count(std::ssize(ledger.cameras[4].missing)) +
                                " in all; --json lists them)"));
}

TEST(Ledger, formats_a_table_of_all_cameras) {
  Ledger ledger{.take = "k", .commanded = 1250, .sensed = 1249, .cameras = {}};
  ledger.cameras.push_back({.name = "cam01",
                            .exposed = 1250,
                            .received = 1249,
                            .written = 1248,
                            .published = 7,
                            .missing = {},
                            .duplicate = {},
                            .suspect = {}});
  EXPECT_THAT(table_lines(ledger),
              testing::ElementsAre("camera    exposed   received    written  published",
                                   "cam01       1,250      1,249      1,248          7",
                                   "1,250 pulses commanded, 1,249 sensed"));
}

TEST(Ledger, reports_what_is_wrong_with_its_file) {
  const test::TemporaryFolder folder;
  const auto error_message = [&](const std::string& text) {
    test::write_text(folder / "ledger.toml", text);
    return test::message_of<InputError>([&] { load_ledger(folder / "ledger.toml"); });
  };
  EXPECT_THAT(error_message("take = \"a\"\ncommanded = -3\nsensed = 0\n"),
              testing::HasSubstr("ledger.toml:2: commanded: expected a count"));
  EXPECT_THAT(error_message("take = \"a\"\ncommanded = 9000000000000000000\nsensed = 0\n"),
              testing::HasSubstr("commanded: expected a count, 0 to 10,000,000"));
  EXPECT_THAT(error_message("take = \"a\"\ncommanded = 3\n"),
              testing::HasSubstr("sensed: missing"));
  EXPECT_THAT(error_message("take = \"a"), testing::HasSubstr("ledger.toml:1"));
  EXPECT_THAT(
      error_message("xxh3 = \"0123456789abcdef\"\ntake = \"a\"\ncommanded = 0\nsensed = 0\n"),
      testing::HasSubstr("ledger.toml: damaged: the checksum in its first line is not that of "
                         "the other lines"));
  EXPECT_THAT(test::message_of<InputError>([&] { load_ledger(folder / "none.toml"); }),
              testing::HasSubstr("none.toml: missing"));
}

}  // namespace
}  // namespace v3d::take
