#include "cli/command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace v3d::cli {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

using Words = std::vector<const char*>;

/// Parses the words after the program's name "studio".
bool parse(Program& program, Words words) {
  words.insert(words.begin(), "studio");
  return program.parse(static_cast<int>(words.size()), words.data());
}

std::optional<int> parse_or_report(Program& program, Words words) {
  words.insert(words.begin(), "studio");
  return program.parse_or_report(static_cast<int>(words.size()), words.data());
}

/// The text of the UsageError that a parse throws; empty: it throws none.
std::string usage_error(Program& program, const Words& words) {
  try {
    parse(program, words);
  } catch (const UsageError& error) {
    return error.what();
  }
  return {};
}

std::string help_of(Program& program, const Words& words = {"--help"}) {
  testing::internal::CaptureStdout();
  EXPECT_FALSE(parse(program, words));
  return testing::internal::GetCapturedStdout();
}

TEST(NumberOption, accepts_numbers_within_its_limits_and_no_nan) {
  const Check seconds = number_in(0.5, 3600);
  for (const char* good : {"0.5", "12", "3600", "1e3"}) EXPECT_EQ(seconds.error(good), "");
  for (const char* bad : {"nan", "-nan", "inf", "-inf", "0.4", "3601", "1e999", "", "ten", "5s"}) {
    EXPECT_EQ(seconds.error(bad),
              std::string("expected a number from 0.5 to 3600, found '") + bad + "'");
  }
}

TEST(IntegerOption, accepts_integers_within_its_limits) {
  const Check count = integer_in(1, 200);
  for (const char* good : {"1", "15", "200"}) EXPECT_EQ(count.error(good), "");
  for (const char* bad : {"0", "-1", "201", "1.5", "", "ten", "99999999999999999999"}) {
    EXPECT_EQ(count.error(bad), std::string("Value ") + bad + " not in range 1 to 200");
  }
}

TEST(NumberOption, distinguishes_positive_and_non_negative_numbers) {
  EXPECT_EQ(positive_number().error("0.1"), "");
  EXPECT_EQ(non_negative_number().error("0"), "");
  for (const std::string bad : {"0", "-1", "nan", "inf", "ten"}) {
    EXPECT_EQ(positive_number().error(bad), "expected a number above 0, found '" + bad + "'");
  }
  for (const std::string bad : {"-0.1", "nan", "inf", "ten"}) {
    EXPECT_EQ(non_negative_number().error(bad),
              "expected 0 or a number above 0, found '" + bad + "'");
  }
}

TEST(ListedOption, accepts_exactly_the_listed_values) {
  const Check role = one_of({"capture", "viewer"});
  EXPECT_EQ(role.error("viewer"), "");
  EXPECT_EQ(role.error("view"), "view not in {capture,viewer}");
  const Check coefficients = one_of({4, 5, 8});
  EXPECT_EQ(coefficients.error("5"), "");
  EXPECT_EQ(coefficients.error("6"), "6 not in {4,5,8}");
  EXPECT_NE(coefficients.error("five"), "");
}

TEST(NumberOfText, is_empty_unless_all_of_the_text_is_a_number) {
  EXPECT_EQ(number_of("-2.5e1"), -25);
  for (const char* bad : {"", "x", "5s", "1,2"}) EXPECT_EQ(number_of(bad), std::nullopt) << bad;
}

TEST(Options, write_the_values_of_the_command_line) {
  Program program("A test");
  std::string name;
  std::filesystem::path file;
  int count = 0;
  uint32_t seed = 0;
  int64_t frames = 0;
  uint64_t serial = 0;
  double seconds = 0;
  std::optional<double> rate, no_rate;
  std::vector<std::string> cameras;
  bool json = false;
  program.add_option("NAME", name);
  program.add_option("-f,--file", file);
  program.add_option("--count", count);
  program.add_option("--seed", seed);
  program.add_option("--frames", frames);
  program.add_option("--serial", serial);
  program.add_option("--seconds", seconds);
  program.add_option("--rate", rate);
  program.add_option("--no-rate", no_rate);
  program.add_option("--cameras", cameras);
  program.add_flag("--json", json);
  ASSERT_TRUE(
      parse(program, {"kendo", "-f", "a b.toml", "--count", "-3", "--seed", "4294967295",
                      "--frames", "-9000000000", "--serial", "18446744073709551615",
                      "--seconds=1.5", "--rate", "25", "--json", "--cameras", "cam1", "cam2"}));
  EXPECT_EQ(name, "kendo");
  EXPECT_EQ(file, "a b.toml");
  EXPECT_EQ(count, -3);
  EXPECT_EQ(seed, UINT32_MAX);
  EXPECT_EQ(frames, -9'000'000'000);
  EXPECT_EQ(serial, UINT64_MAX);
  EXPECT_EQ(seconds, 1.5);
  EXPECT_EQ(rate, 25);
  EXPECT_EQ(no_rate, std::nullopt);
  EXPECT_THAT(cameras, ElementsAre("cam1", "cam2"));
  EXPECT_TRUE(json);
}

TEST(Options, that_are_not_given_leave_their_variables_as_they_are) {
  Program program("A test");
  std::string name = "before";
  std::string other;
  const Option option = program.add_option("--name", name);
  const Option given = program.add_option("--other", other);
  ASSERT_TRUE(parse(program, {"--other", ""}));
  EXPECT_EQ(name, "before");
  EXPECT_FALSE(option.is_given());
  EXPECT_TRUE(given.is_given());
}

TEST(Options, are_rejected_with_one_line) {
  Program program("A test");
  int count = 0;
  std::string out;
  program.add_option("--count", count).check(integer_in(1, 9));
  program.add_option("--out", out).required();
  EXPECT_EQ(usage_error(program, {}), "--out is required");
  EXPECT_EQ(usage_error(program, {"--out", "x", "--count", "10"}),
            "--count: Value 10 not in range 1 to 9");
  EXPECT_THAT(usage_error(program, {"--out", "x", "--count", "ten"}), StartsWith("--count: "));
  EXPECT_THAT(usage_error(program, {"--out", "x", "--speed"}), HasSubstr("--speed"));
  EXPECT_EQ(usage_error(program, {"--out", "x", "--count", "9"}), "");
}

TEST(Options, may_be_required_not_at_all) {
  Program program("A test");
  std::string out;
  program.add_option("--out", out).required(false);
  EXPECT_TRUE(parse(program, {}));
}

TEST(Options, can_need_or_exclude_another) {
  Program program("A test");
  int processes = 0;
  bool slurm = false;
  std::string partition;
  const Option first = program.add_option("--processes", processes);
  const Option second = program.add_flag("--slurm", slurm).excludes(first);
  program.add_option("--partition", partition).needs(second);
  EXPECT_EQ(usage_error(program, {"--slurm", "--processes", "2"}), "--processes excludes --slurm");
  EXPECT_EQ(usage_error(program, {"--partition", "night"}), "--partition requires --slurm");
  EXPECT_EQ(usage_error(program, {"--partition", "night", "--slurm"}), "");
}

TEST(Options, of_lists_take_all_words_that_follow_or_one_word_or_the_parts_of_a_word) {
  Program program("A test");
  std::vector<std::string> names, from, cameras, voxels;
  program.add_option("NAMES", names);
  program.add_option("--camera", cameras);
  program.add_option("--from", from).take_one_word();
  program.add_option("--voxel", voxels).delimiter(',');
  ASSERT_TRUE(parse(program, {"--from", "a=1", "kendo-07", "--from", "b=2", "--voxel", "8mm,10mm",
                              "--camera", "cam01", "cam02"}));
  EXPECT_THAT(from, ElementsAre("a=1", "b=2"));
  EXPECT_THAT(names, ElementsAre("kendo-07"));
  EXPECT_THAT(cameras, ElementsAre("cam01", "cam02"));
  EXPECT_THAT(voxels, ElementsAre("8mm", "10mm"));
}

TEST(Help, shows_types_defaults_limits_and_the_footer_but_no_hidden_option) {
  Program program("What the program is.", "studio");
  std::string size = "640x480";
  int count = 3;
  bool old = false;
  std::vector<std::string> names, from;
  program.add_option("NAMES", names);
  program.add_option("--from", from).take_one_word();
  program.add_option("--size", size, "Size of images").type_name("WxH").show_default();
  program.add_option("--count", count, "Number").check(integer_in(1, 9));
  program.add_flag("--former", old).hide();
  program.add_subcommand("shards", "An internal task").hide();
  program.add_subcommand("take", "Write a take");
  program.footer("Example: studio");
  EXPECT_THAT(help_of(program),
              AllOf(StartsWith("What the program is."), HasSubstr("--size WxH=640x480"),
                    HasSubstr("Size of images"), HasSubstr("--count INT:INT in [1 - 9]"),
                    HasSubstr("Write a take"), HasSubstr("NAMES TEXT ..."),
                    Not(HasSubstr("--from TEXT ...")), HasSubstr("Example: studio"),
                    Not(HasSubstr("former")), Not(HasSubstr("shards"))));
}

TEST(Help, does_not_need_the_required_options) {
  Program program("A test");
  std::string out;
  program.add_option("--out", out).required();
  EXPECT_THAT(help_of(program), HasSubstr("REQUIRED"));
}

TEST(Version, is_printed_instead_of_a_parse) {
  Program program("A test");
  program.add_version("studio 1.2.3");
  EXPECT_EQ(help_of(program, {"--version"}), "studio 1.2.3\n");
}

TEST(Subcommand, must_be_given_exactly_once_where_it_is_required) {
  Program program("A test");
  program.require_subcommand();
  program.add_subcommand("arm", "");
  program.add_subcommand("stop", "");
  EXPECT_EQ(usage_error(program, {"arm"}), "");
  EXPECT_EQ(usage_error(program, {}), "A subcommand is required");
  EXPECT_NE(usage_error(program, {"arm", "stop"}), "");
  EXPECT_NE(usage_error(program, {"dance"}), "");
}

TEST(Subcommand, runs_its_action_alone_after_the_parse) {
  Program program("A test");
  std::vector<std::string> ran;
  std::string name;
  Command takes = program.add_subcommand("takes", "");
  Command slate = takes.add_subcommand("slate", "");
  slate.add_option("NAME", name);
  takes.on_parsed([&] { ran.emplace_back("takes"); });
  slate.on_parsed([&] { ran.push_back("slate " + name); });
  ASSERT_TRUE(parse(program, {"takes", "slate", "kendo"}));
  EXPECT_THAT(ran, ElementsAre("slate kendo"));
  ran.clear();
  ASSERT_TRUE(parse(program, {"takes"}));
  EXPECT_THAT(ran, ElementsAre("takes"));
  ran.clear();
  EXPECT_NE(usage_error(program, {"takes", "--dance"}), "");
  EXPECT_THAT(ran, IsEmpty());
}

TEST(Subcommand, passes_the_exception_of_its_action_through_the_parse) {
  Program program("A test");
  program.add_subcommand("arm", "").on_parsed([] { throw std::runtime_error("no camera"); });
  try {
    parse(program, {"arm"});
    FAIL() << "no exception";
  } catch (const UsageError&) {
    FAIL() << "the command line is right";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "no camera");
  }
}

TEST(Subcommand, accepts_options_of_its_parent_only_where_it_says_so) {
  Program program("A test");
  std::string studio;
  program.add_option("--studio", studio);
  program.add_subcommand("arm", "").accept_parent_options();
  program.add_subcommand("stop", "");
  EXPECT_EQ(usage_error(program, {"arm", "--studio", "a.toml"}), "");
  EXPECT_EQ(studio, "a.toml");
  EXPECT_NE(usage_error(program, {"stop", "--studio", "b.toml"}), "");
}

TEST(Subcommand, may_leave_all_further_words_unparsed) {
  Program program("A test");
  bool ran = false;
  Command import = program.add_subcommand("import", "");
  import.parse_no_further();
  import.on_parsed([&] { ran = true;
});
EXPECT_TRUE(parse(program, {"import", "--help", "--dance", "take"}));
EXPECT_TRUE(ran);
}  // namespace

TEST(Report, has_the_exit_status_of_a_program_that_must_end) {
  Program program("A test", "studio");
  std::string out;
  program.add_option("--out", out).required();
  EXPECT_EQ(parse_or_report(program, {"--out", "x"}), std::nullopt);

  testing::internal::CaptureStdout();
  EXPECT_EQ(parse_or_report(program, {"--help"}), 0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("--out"));

  testing::internal::CaptureStderr();
  const std::optional<int> status = parse_or_report(program, {});
  EXPECT_THAT(testing::internal::GetCapturedStderr(), StartsWith("--out is required\n"));
  ASSERT_TRUE(status);
  EXPECT_NE(*status, 0);
}

TEST(Command, cannot_have_two_options_of_one_name) {
  Program program("A test");
  std::string out;
  program.add_option("--out", out);
  EXPECT_THROW(program.add_option("--out", out), std::runtime_error);
}

}  // namespace v3d::cli
}  // namespace v3d::cli
