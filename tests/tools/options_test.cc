#include "v3dctl/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"
#include "v3dctl/reconstruct/reconstruct_options.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;

TEST(FrameRange, contains_all_frames_by_default) {
  EXPECT_EQ(parse_frame_range(""), take::FrameRange{});
}

TEST(FrameRange, ends_before_its_second_number) {
  EXPECT_EQ(parse_frame_range("3:7"), (take::FrameRange{3, 7}));
  EXPECT_TRUE(parse_frame_range("3:7").contains(6));
  EXPECT_FALSE(parse_frame_range("3:7").contains(7));
}

TEST(FrameRange, may_be_open_at_either_end_or_a_single_frame) {
  EXPECT_EQ(parse_frame_range("3:").begin, 3);
  EXPECT_EQ(parse_frame_range(":7"), (take::FrameRange{0, 7}));
  EXPECT_EQ(parse_frame_range("5"), (take::FrameRange{5, 6}));
}

TEST(FrameRange, rejects_an_invalid_range) {
  for (const char* text :
       {":", "7:3", "3:3", "a:b", "-1:4", "1:2:3", "1.5", " 1", "1 :2", "99999999999999999999"}) {
    EXPECT_THROW(parse_frame_range(text), InputError) << text;
  }
}

TEST(ViewSource, is_rejected_without_view_dependent_colours_which_alone_use_it) {
  const std::vector<std::string> render{"render", "/not/there", "/tmp/a.png", "--turntable", "8"};
  const std::vector<std::string> evaluate{"evaluate", "/not/there", "--held-out", "a"};
  for (const auto& [add, command] : {std::pair(&add_render, render), {&add_evaluate, evaluate}}) {
    std::vector<std::string> words = command;
    words.insert(words.end(), {"--view-source", "mesh"});
    const test::CommandOutcome outcome = test::run_command(add, words);
    EXPECT_EQ(outcome.status, kExitBadInput);
    EXPECT_THAT(outcome.error, testing::HasSubstr("--view-source requires --view-dependent"));
    words.emplace_back("--view-dependent");
    EXPECT_THAT(test::run_command(add, words).error, testing::HasSubstr("/not/there"));
  }
}

TEST(Lengths, that_are_invalid_are_reported_with_their_option) {
  EXPECT_EQ(parse_length_option("8mm", "--unit"), 0.008);
  EXPECT_THAT(test::message_of<InputError>([] { parse_length_option("0m", "--unit"); }),
              testing::StartsWith("--unit: length '0m': expected a positive number"));
}

TEST(OutputFiles, can_be_replaced_but_not_created_in_an_absent_folder) {
  const test::TemporaryFolder folder;
  EXPECT_NO_THROW(check_output({"--out", folder / "new.toml"}));
  EXPECT_NO_THROW(check_output({"--out", {}}));
  EXPECT_THROW(check_output({"--out", folder / "absent" / "new.toml"}), InputError);
  EXPECT_THROW(check_output({"--out", folder.path()}), InputError);
  EXPECT_NO_THROW(require_other_file({"--report", {}}, {{"--before", {}}}));
  EXPECT_THROW(
      require_other_file({"--report", folder / "a"}, {{"--out", folder / "b" / ".." / "a"}}),
      InputError);
}

TEST(OutputFiles, that_are_recorded_files_are_rejected) {
  const test::TemporaryFolder take;
  replace_file(take / "calib.toml", "");
  EXPECT_NO_THROW(check_output({"--out", take / "calib.toml"}));
  replace_file(take / "take.toml", "");
  for (const char* name : {"calib.toml", "cam01.lcmlog"}) {
    EXPECT_THAT(test::message_of<InputError>([&] {
                  check_output({"--out", take / name});
                }),
                testing::HasSubstr(std::string(name) + ": is a recorded file of a take"));
  }
}

TEST(CameraFiles, keep_their_order_and_any_equals_sign_in_the_file_name) {
  EXPECT_THAT(parse_camera_files({"b=1.avi", "a=x=y.avi"}, "--video"),
              ElementsAre(CameraFile{"b", "1.avi"}, CameraFile{"a", "x=y.avi"}));
}

TEST(CameraFiles, reject_missing_parts_and_a_camera_given_twice) {
  EXPECT_THROW(parse_camera_files({"1.avi"}, "--video"), InputError);
  EXPECT_THROW(parse_camera_files({"=1.avi"}, "--video"), InputError);
  EXPECT_THROW(parse_camera_files({"a="}, "--video"), InputError);
  EXPECT_THROW(parse_camera_files({"a=1.avi", "a=2.avi"}, "--video"), InputError);
}

TEST(Names, are_split_at_commas) {
  EXPECT_THAT(parse_names("a,b,c", "--leave-out"), ElementsAre("a", "b", "c"));
  EXPECT_THAT(parse_names("a", "--leave-out"), ElementsAre("a"));
  EXPECT_THAT(parse_names("", "--leave-out"), ElementsAre());
}

TEST(Names, must_not_be_empty) {
  for (const char* text : {",", "a,", ",a", "a,,b"}) {
    EXPECT_THROW(parse_names(text, "--leave-out"), InputError) << text;
  }
}

TEST(Deform, accepts_its_numbers_in_any_order) {
  const recon::DeformOptions o = parse_deform("window=7,mode=paper,silhouette=0,views=4,carving=0");
  EXPECT_EQ(o.mode, recon::DeformMode::kPaper);
  EXPECT_EQ(o.window, 7);
  EXPECT_EQ(o.views, 4);
  EXPECT_EQ(o.silhouette, 0);
  EXPECT_EQ(o.photometric, 0.4);
  EXPECT_FALSE(o.carve_concavities);
  EXPECT_TRUE(parse_deform("carving=1").carve_concavities);
  EXPECT_FALSE(parse_deform("hollows=0").carve_concavities) << "the former name";
  EXPECT_EQ(parse_deform("").mode, recon::DeformMode::kSearch);
}

TEST(RepairPulses, are_frames_and_ranges_in_any_order) {
  EXPECT_THAT(parse_repair_pulses("7:10,3,8:9", {}), ElementsAre(3, 7, 8, 9));
  for (const char* text : {"5:", "x", "3,,4", "7:3", "alive"}) {
    EXPECT_THROW(parse_repair_pulses(text, {}), InputError) << text;
  }
}

TEST(RepairPulses, are_read_from_the_take) {
  const test::TemporaryFolder take;
  EXPECT_THAT(parse_repair_pulses("live", {take.path()}), testing::IsEmpty());
  test::write_text(take / "repaired.recon01.txt", "4\n6\n");
  EXPECT_THAT(parse_repair_pulses("live", {take.path()}), ElementsAre(4, 6));
}

TEST(Deform, rejects_unknown_names) {
  for (const char* text : {"window", "window=", "window=x", "window=4", "mode=fast", "alpha=1",
                           "internal=-1", "views=6.5", "carving=2"}) {
    EXPECT_THROW(parse_deform(text), InputError) << text;
  }
}

}  // namespace
}  // namespace v3d::ctl
