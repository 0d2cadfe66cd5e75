#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/data_url.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/render/renderer.h"
#include "support/file_size_limit.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/take_listing.h"
#include "tools/gliding_take.h"
#include "v3dctl/command_line.h"
#include "v3dctl/edit/editor.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

std::vector<Edit> parse(const std::string& operations) {
  return parse_edits(R"({"format": "v3d-edit", "version": 1, "operations": [)" + operations + "]}",
                     "/studio/edit.json");
}

std::string rejection(const std::string& operations) {
  return test::message_of<InputError>([&] { parse(operations); });
}

TEST(EditFile, has_the_operations_in_order_with_their_defaults) {
  const std::vector<Edit> edits = parse(R"(
    {"do": "cut", "frames": [5, 20]}, {"do": "stretch", "factor": 0.5}, {"do": "mirror"},
    {"do": "bend", "joint": "right_knee", "degrees": 30, "axis": [0, 2, 0], "ramp": 4},
    {"do": "splice", "take": "other/take", "at": [3, 9]}, {"do": "hold_feet"})");
  ASSERT_EQ(edits.size(), 6U);
  EXPECT_EQ(std::get<CutEdit>(edits[0].operation).frames.end, 20);
  EXPECT_FALSE(std::get<StretchEdit>(edits[1].operation).frames);
  const auto& bend = std::get<BendEdit>(edits[3].operation);
  EXPECT_EQ(bend.joint, recon::kRightKnee);
  EXPECT_NEAR(bend.axis.y(), 1, 1e-12);
  const auto& splice = std::get<SpliceEdit>(edits[4].operation);
  EXPECT_EQ(splice.take, "/studio/other/take");
  EXPECT_EQ(splice.blend, 10);
  EXPECT_FALSE(splice.from);
  EXPECT_EQ(std::get<HoldFeetEdit>(edits[5].operation).fade, 5);
}

/// Files with which docs/edit.schema.json is compared, too.
const nlohmann::json& cases() {
  static const nlohmann::json parsed = nlohmann::json::parse(read_file(V3D_EDIT_CASES));
  return parsed;
}

TEST(EditFile, is_accepted_with_all_operations_and_keys) {
  ASSERT_FALSE(cases().at("accepted").empty());
  for (const nlohmann::json& edit : cases().at("accepted")) {
    const std::vector<Edit> edits = parse_edits(edit.dump(), "/studio/edit.json");
    EXPECT_EQ(edits.size(), edit.at("operations").size());
  }
}

TEST(EditFile, is_rejected_with_the_field_and_what_would_be_right) {
  ASSERT_FALSE(cases().at("rejected").empty());
  for (const nlohmann::json& rejected : cases().at("rejected")) {
    const std::string operation = rejected.at("operation").dump();
    EXPECT_THAT(rejection(operation), HasSubstr(rejected.at("message").get<std::string>()))
        << operation;
  }
  EXPECT_THAT(rejection(R"({"do": "mirror"}, {"do": "cut"})"),
              HasSubstr("operations[1]: 'frames' is missing"));
}

TEST(EditFile, knows_the_joints_of_its_json_schema) {
  const auto schema = nlohmann::json::parse(read_file(V3D_EDIT_SCHEMA));
  const auto& names = schema.at("definitions").at("joint").at("enum");
  ASSERT_EQ(names.size(), size_t{recon::kJoints});
  for (size_t j = 0; j < recon::kJoints; ++j) {
    EXPECT_EQ(names[j].get<std::string>(), recon::name(static_cast<recon::Joint>(j)));
  }
}

TEST(EditFile, is_rejected_when_it_is_no_edit) {
  const auto message = [](const std::string& text) {
    return test::message_of<InputError>([&] { parse_edits(text, "e.json"); });
  };
  EXPECT_EQ(message("{"), "e.json: is no JSON");
  EXPECT_THAT(message(R"({"format": "v3d-scene"})"), HasSubstr("format: expected \"v3d-edit\""));
  EXPECT_THAT(message(R"({"format": "v3d-edit", "version": 2, "operations": []})"),
              HasSubstr("version: expected a whole number from 1 to 1"));
}

class EditTake : public testing::Test {
 protected:
  static constexpr int kPulses = test::kGlidingPulses;

  EditTake() : take_(folder_ / "take") { test::write_gliding_take(take_); }

  TakeClip read() {
    return read_clip(
        take_, [](int64_t) {}, [] {});
  }

  test::TemporaryFolder folder_;
  const fs::path take_;
};

TEST_F(EditTake, is_written_as_a_take_that_every_command_reads) {
  TakeClip edited = read();
  ASSERT_EQ(edited.clip.frames.size(), size_t{kPulses});
  const Box before = recon::bounds_of({edited.clip.frames[2].positions, {}, {}});
  recon::cut(edited.clip, {2, 6});
  recon::bend(edited.clip,
              {.joint = recon::kLeftShoulder, .range = {0, 4}, .radians = -1.2, .ramp = 1});
  const fs::path out = folder_ / "edited";
  write_clip(edited, take_, "{}", out);
  recorded::MeshFrames meshes(out);
  EXPECT_EQ(meshes.frames({}), (std::vector<int64_t>{0, 1, 2, 3}));
  const Box after = recon::bounds_of(meshes.read(1).mesh);
  EXPECT_NEAR(after.min.z(), before.min.z(), 0.005) << "the feet stay";
  EXPECT_EQ(take::load_take_info({out}).pulses, 4);
  const auto skeleton = nlohmann::json::parse(read_file(out / "skeleton.json"));
  EXPECT_EQ(skeleton.at("pulses").size(), 4U);
  ASSERT_EQ(skeleton.at("skins").size(), 1U);
  EXPECT_EQ(skeleton.at("skins")[0].at("pulses"), (std::vector<int64_t>{0, 1, 2, 3}));
  EXPECT_EQ(skeleton.at("skins")[0].at("vertices"), edited.clip.frames[0].positions.size());
  EXPECT_EQ(read_file(out / "edit.json"), "{}");
}

TEST_F(EditTake, keeps_its_speed_where_pulses_are_lost) {
  test::write_gliding_motion(take::TakePaths{take_}.motion(), {{0, 2, 4, 6, 8}});
  const TakeClip edited = read();
  ASSERT_EQ(edited.clip.frames.size(), 9U);
  EXPECT_EQ(edited.left_out, 0);
  const float first = edited.clip.frames[0].positions[0].x();
  for (size_t f = 0; f < 9; ++f) {
    EXPECT_NEAR(edited.clip.frames[f].positions[0].x() - first, 0.01 * static_cast<double>(f),
                1e-3);
  }
}

TEST_F(EditTake, is_rejected_where_more_pulses_are_lost_than_the_tracker_leaves_in_a_segment) {
  test::write_gliding_motion(take::TakePaths{take_}.motion(), {{0, 1, 11}});
  EXPECT_EQ(read().clip.frames.size(), 12U);
  test::write_gliding_motion(take::TakePaths{take_}.motion(), {{0, 1, 12}});
  EXPECT_THAT(
      test::message_of<InputError>([&] { read(); }),
      HasSubstr("motion.v3d: pulse 12 follows pulse 1 in a segment; expected at most 9 lost "
                "pulses between them"));
}

TEST_F(EditTake, counts_lost_pulses_between_two_surfaces_as_left_out) {
  test::write_gliding_motion(take::TakePaths{take_}.motion(), {{0, 1, 2}, {6, 7, 8}});
  const TakeClip edited = read();
  EXPECT_EQ(edited.clip.frames.size(), 6U);
  EXPECT_EQ(edited.left_out, 3);
}

TEST_F(EditTake, has_the_bone_lengths_that_the_positions_of_its_joints_have) {
  const fs::path out = folder_ / "edited";
  write_clip(read(), take_, "{}", out);
  const auto skeleton = nlohmann::json::parse(read_file(out / "skeleton.json"));
  const auto& joints = skeleton.at("joints");
  const auto& positions = skeleton.at("pulses")[0].at("positions");
  std::map<std::string, Eigen::Vector3d> joint_positions;
  int bones = 0;
  for (size_t j = 0; j < joints.size(); ++j) {
    const auto name = joints[j].at("name").get<std::string>();
    const auto position = positions[j].get<std::array<double, 3>>();
    joint_positions[name] = {position[0], position[1], position[2]};
    if (!joints[j].contains("bone_m")) continue;
    const auto parent = joints[j].at("parent").get<std::string>();
    const double metres = (joint_positions.at(name) - joint_positions.at(parent)).norm();
    EXPECT_NEAR(joints[j].at("bone_m").get<double>(), metres, 0.002) << name;
    ++bones;
  }
  EXPECT_EQ(bones, 14);
}

TEST_F(EditTake, is_listed_as_edited_and_not_as_incomplete) {
  const fs::path out = folder_ / "edited";
  write_clip(read(), take_, "{}", out);
  const take::TakeListing listing = take::read_take_listing({out});
  EXPECT_EQ(listing.verdict(), "edited");
  EXPECT_EQ(listing.meshes, kPulses);
  test::write_text(take::TakePaths{out}.ledger(), "");
  EXPECT_FALSE(take::is_edited({out})) << "a recording is no edited take";
}

TEST_F(EditTake, replaces_an_earlier_edit_and_nothing_else) {
  const TakeClip edited = read();
  const fs::path out = folder_ / "edited";
  write_clip(edited, take_, "{}", out);
  write_clip(edited, take_, "{ }", out);
  EXPECT_EQ(read_file(out / "edit.json"), "{ }");
  const std::string message =
      test::message_of<InputError>([&] { write_clip(edited, take_, "{}", take_); });
  EXPECT_THAT(message, HasSubstr("holds something else than an edited take"));
  EXPECT_FALSE(fs::exists(take_ / "edit.json"));
}

TEST_F(EditTake, stays_whole_when_a_later_edit_cannot_be_written) {
  const TakeClip edited = read();
  const fs::path out = folder_ / "edited";
  write_clip(edited, take_, "{}", out);
  {
    const test::FileSizeLimit limit(8192);  // less than motion.v3d
    EXPECT_THROW(write_clip(edited, take_, "{ }", out), std::runtime_error);
  }
  EXPECT_EQ(read_file(out / "edit.json"), "{}");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 2)
      << "the take and the edited one";
}

TEST_F(EditTake, is_not_written_over_a_recording_that_holds_the_list_of_operations) {
  const fs::path recorded = folder_ / "recorded";
  fs::create_directory(recorded);
  test::write_text(recorded / "edit.json", "{}");
  test::write_text(recorded / "calib.toml", "recorded");
  test::write_text(recorded / "ledger.toml", "recorded");
  const TakeClip edited = read();
  EXPECT_THROW(write_clip(edited, take_, "{}", recorded), InputError);
  EXPECT_EQ(read_file(recorded / "calib.toml"), "recorded");
}

TEST_F(EditTake, has_the_name_of_its_folder_also_when_a_slash_follows) {
  write_clip(read(), take_, "{}", folder_ / "edited" / "");
  EXPECT_EQ(take::load_take_info({folder_ / "edited"}).name, "edited");
}

TEST_F(EditTake, is_not_written_to_a_folder_whose_name_is_no_take_name) {
  const TakeClip edited = read();
  for (const std::string& name : {std::string("take.turn (2)"), std::string(65, 'a')}) {
    EXPECT_THAT(test::message_of<InputError>([&] { check_output(folder_ / name); }),
                HasSubstr("'" + name + "' cannot name a take; choose another OUT: use letters"));
    EXPECT_THROW(write_clip(edited, take_, "{}", folder_ / name), InputError);
    EXPECT_FALSE(fs::exists(folder_ / name));
  }
}

TEST_F(EditTake, has_a_skin_for_each_segment_where_surfaces_alternate) {
  TakeClip edited = read();
  edited.clip.surfaces.push_back(edited.clip.surfaces[0]);
  edited.clip.frames[2].surface = edited.clip.frames[3].surface = 1;
  const fs::path out = folder_ / "edited";
  write_clip(edited, take_, "{}", out);
  const auto skins = nlohmann::json::parse(read_file(out / "skeleton.json")).at("skins");
  ASSERT_EQ(skins.size(), 3U);
  EXPECT_EQ(skins[1].at("pulses"), (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(skins[2].at("pulses"), (std::vector<int64_t>{4, 5}));
}

/// A part for each vertex of the gliding person. The height lies between two layers of vertices.
recon::Joint part_at(const Eigen::Vector3f& place) {
  return place.z() > 1.505F ? recon::kHead : recon::kPelvis;
}

TEST_F(EditTake, has_the_weights_of_its_own_vertices_after_a_mirror) {
  const Mesh before = recorded::MeshFrames(take_).read(0).mesh;
  TakeClip edited = read();
  std::vector<recon::SkinInfluence>& influences = edited.clip.surfaces[0].skin.influences;
  ASSERT_EQ(influences.size(), before.vertices.size());
  for (size_t v = 0; v < influences.size(); ++v) {
    influences[v].part.fill(part_at(before.vertices[v]));
    influences[v].weight = {1, 0, 0, 0};
  }
  recon::mirror(edited.clip);
  const fs::path out = folder_ / "edited";
  write_clip(edited, take_, "{}", out);
  const Mesh after = recorded::MeshFrames(out).read(0).mesh;
  std::vector<uint8_t> expected;  // four joints and four weights for each vertex
  for (const Eigen::Vector3f& place : after.vertices) {
    expected.push_back(static_cast<uint8_t>(part_at(place)));
    expected.insert(expected.end(), {0, 0, 0, 255, 0, 0, 0});
  }
  const auto skeleton = nlohmann::json::parse(read_file(out / "skeleton.json"));
  const auto weights = skeleton.at("skins")[0].at("weights").get<std::string>();
  EXPECT_TRUE(weights == base64(expected));
}

/// A take and the edit file edits/turn.json. The status of an edit is kExitIncomplete, because no
/// pulse of the take shows hands.
class EditCommand : public testing::Test {
 protected:
  EditCommand() {
    fs::create_directories(folder_ / "takes");
    fs::create_directories(folder_ / "edits");
    test::write_gliding_take(folder_ / "takes/dancer");
  }

  void put(const std::string& operation) const {
    test::write_text(edits_,
                     R"({"format": "v3d-edit", "version": 1, "operations": [)" + operation + "]}");
  }

  /// The exit status of `v3dctl edit takes/dancer edits/turn.json OPTIONS`.
  int run(const std::vector<std::string>& options = {}) const {
    std::vector<std::string> words{"v3dctl", "edit", (folder_ / "takes/dancer").string(),
                                   edits_.string()};
    words.insert(words.end(), options.begin(), options.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    return run_program(static_cast<int>(argv.size()), argv.data(), add_edit);
  }

  const test::TemporaryFolder folder_;
  const fs::path edits_ = folder_ / "edits/turn.json", out_ = folder_ / "takes/dancer.turn";
};

TEST_F(EditCommand, writes_a_copy_of_the_operations_whose_paths_lead_from_its_folder) {
  test::write_gliding_take(folder_ / "takes/rehearsal");
  put(R"({"do": "cut", "frames": [0, 5]}, {"do": "splice", "take": "../takes/rehearsal", "blend": 2},
         {"do": "swap", "take": "../takes/rehearsal", "frame": 1})");
  ASSERT_EQ(run(), kExitIncomplete);
  const std::vector<Edit> copy = load_edits(out_ / "edit.json");
  ASSERT_EQ(copy.size(), 3U);
  EXPECT_EQ(std::get<SwapEdit>(copy[2].operation).take, folder_ / "takes/rehearsal");
  EXPECT_EQ(std::get<CutEdit>(copy[0].operation).frames.end, 5);
  const auto& splice = std::get<SpliceEdit>(copy[1].operation);
  EXPECT_EQ(splice.blend, 2);
  EXPECT_EQ(splice.take, folder_ / "takes/rehearsal");
}

TEST_F(EditCommand, does_not_replace_a_take_that_it_reads) {
  put(R"({"do": "cut", "frames": [0, 5]})");
  ASSERT_EQ(run(), kExitIncomplete);
  const std::string before = read_file(out_ / "motion.v3d");
  for (const char* other : {R"({"do": "splice", "take": "../takes/dancer.turn", "blend": 2})",
                            R"({"do": "swap", "take": "../takes/dancer.turn"})"}) {
    put(R"({"do": "mirror"}, )" + std::string(other));
    testing::internal::CaptureStderr();
    EXPECT_EQ(run(), kExitBadInput);
    EXPECT_THAT(testing::internal::GetCapturedStderr(),
                HasSubstr("operations[1].take: " + out_.string() + " is OUT itself"));
    EXPECT_EQ(read_file(out_ / "motion.v3d"), before);
  }
}

TEST_F(EditCommand, states_no_relative_jump_where_the_surface_stands_still_around_a_splice) {
  put(R"({"do": "cut", "frames": [0, 1]}, {"do": "stretch", "factor": 10},
         {"do": "splice", "take": "../takes/dancer", "at": [8, 9], "from": [4, 5], "blend": 1})");
  testing::internal::CaptureStdout();
  EXPECT_EQ(run({"--json"}), kExitIncomplete);
  const auto json = nlohmann::json::parse(testing::internal::GetCapturedStdout());
  ASSERT_EQ(json.at("splices").size(), 1U);
  EXPECT_FALSE(json.at("splices")[0].contains("relative_jump"));
  EXPECT_TRUE(json.at("splices")[0].contains("cost_mm"));
  testing::internal::CaptureStdout();
  EXPECT_EQ(run(), kExitIncomplete);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              testing::ContainsRegex("the poses differ by [0-9]+ mm\n"));
}

TEST_F(EditCommand, states_the_frame_of_the_other_take_that_follows_a_splice) {
  put(R"({"do": "splice", "take": "../takes/dancer", "at": [1, 2], "from": [0, 1], "blend": 4})");
  testing::internal::CaptureStdout();
  EXPECT_EQ(run(), kExitIncomplete);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("frame 3: continues with frame 2 of the other take"));
}

TEST_F(EditCommand, states_that_joints_can_be_anywhere_where_no_pulse_shows_the_ends_of_the_body) {
  test::write_gliding_take(folder_ / "takes/rehearsal");
  put(R"({"do": "splice", "take": "../takes/rehearsal", "blend": 2},
         {"do": "swap", "take": "../takes/rehearsal"})");
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  EXPECT_EQ(run({"--json"}), kExitIncomplete);
  const auto json = nlohmann::json::parse(testing::internal::GetCapturedStdout());
  const std::string printed = testing::internal::GetCapturedStderr();
  const auto problems = json.at("problems").get<std::vector<std::string>>();
  for (const char* take : {"takes/dancer", "takes/rehearsal"}) {
    const std::string line = (folder_ / take).string() + ": no pulse shows head, feet and hands";
    EXPECT_EQ(std::ranges::count_if(problems, [&](auto& p) { return p.starts_with(line); }), 1);
    EXPECT_THAT(printed, HasSubstr("v3dctl: " + line));
  }
}

TEST_F(EditCommand, is_done_where_a_pulse_shows_the_ends_of_the_body) {
  test::write_gliding_motion(folder_ / "takes/dancer/motion.v3d", {{0, 1, 2}, {2, 3, 4}});
  put(R"({"do": "mirror"})");
  testing::internal::CaptureStdout();
  EXPECT_EQ(run({"--json"}), kExitDone);
  const auto json = nlohmann::json::parse(testing::internal::GetCapturedStdout());
  EXPECT_THAT(json.at("problems").dump(), testing::Not(HasSubstr("no pulse shows")));
}

TEST_F(EditTake, states_which_frames_it_has_when_another_one_is_read) {
  recorded::MeshFrames frames(take_);
  EXPECT_EQ(test::message_of<InputError>([&] { frames.read(7); }),
            (take_ / "motion.v3d").string() + ": has no frame 7; it has 6 from 0 to 5");
}

TEST_F(EditTake, needs_a_tracked_surface) {
  fs::remove(take::TakePaths{take_}.motion());
  EXPECT_THAT(test::message_of<InputError>([&] { read(); }),
              HasSubstr("has no tracked surface: run v3dctl track first"));
}

}  // namespace
}  // namespace v3d::ctl
