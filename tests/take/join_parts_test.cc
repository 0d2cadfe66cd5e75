#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/message_of.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/joined_slate.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file.h"
#include "take/logs/repaired_pulses.h"
#include "take/take_listing.h"
#include "take/take_transfer.h"

namespace v3d::take {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// The parts of a take of three pulses: two capture nodes and a reconstruction node.
class JoinParts : public testing::Test {
 protected:
  JoinParts() {
    record("cap01", {"cam01", "cam02"}, 3);
    record("cap02", {"cam03"}, 3);
    std::filesystem::create_directories(part("recon01").folder);
    test::write_text(part("recon01").mesh(), "meshes");
  }

  TakePaths part(const std::string& node) const { return {folder_ / node}; }

  /// Writes a mesh file of the node with pulses 0 to `meshes` - 1.
  void reconstruct(const std::string& node, int64_t meshes) const {
    std::filesystem::create_directories(part(node).folder);
    MeshFileWriter file(part(node).mesh());
    for (int64_t pulse = 0; pulse < meshes; ++pulse)
      EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>{1}));
    EXPECT_TRUE(file.close());
  }

  void record(const std::string& node, const std::vector<std::string>& cameras, int64_t pulses) {
    const TakePaths paths = part(node);
    std::filesystem::remove_all(paths.folder);
    std::filesystem::create_directories(paths.background());
    TakeInfo info = test::begun_take(cameras);
    info.pulses = pulses;
    info.state = TakeState::kComplete;
    EXPECT_TRUE(save_take_info(paths, info));
    test::write_text(paths.calib(), "# the rig\n");
    Ledger ledger{.take = "kendo-07", .commanded = pulses, .sensed = pulses, .cameras = {}};
    EventLogWriter sensed(paths.pulses());
    for (int64_t pulse = 0; pulse < pulses; ++pulse) {
      wire::PulseMessage message;
      message.pulse = pulse;
      EXPECT_TRUE(sensed.write(message));
    }
    for (const std::string& camera : cameras) {
      test::write_text(paths.background() / (camera + ".toml"), camera);
      EventLogWriter frames(paths.frames(camera));
      std::vector<int64_t> written;
      for (int64_t pulse = 0; pulse < pulses; ++pulse) {
        EXPECT_TRUE(frames.write(test::recorded_frame(camera, pulse, {4, 2})));
        written.push_back(pulse);
      }
      ledger.cameras.push_back(account(camera, written, {}, pulses));
    }
    EXPECT_TRUE(save_ledger(paths.ledger(), ledger));
  }

  TakeInfo join() const {
    return join_parts({part("recon01"), part("cap01"), part("cap02")}, whole_);
  }

  const test::TemporaryFolder folder_;
  const TakePaths whole_{folder_ / "whole"};
};

TEST_F(JoinParts, rejects_a_part_that_has_logs_and_no_take_toml) {
  std::filesystem::remove(part("cap02").info());
  EXPECT_THAT(test::message_of<InputError>([&] {
                join_parts({part("cap01"), part("cap02")}, TakePaths{folder_ / "whole"});
              }),
              HasSubstr("cap02: has logs of cameras and no take.toml"));
}

TEST_F(JoinParts, creates_one_take_that_verifies) {
  EXPECT_THAT(join().cameras, ElementsAre("cam01", "cam02", "cam03"));
  std::filesystem::remove(whole_.mesh());  // the mesh file of this test is invalid
  const Verification verified = verify_take(whole_);
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict();
  EXPECT_THAT(verified.disagreements, IsEmpty());
  EXPECT_EQ(read_file(whole_.background() / "cam03.toml"), "cam03");
  EXPECT_TRUE(std::filesystem::exists(part("cap01").frames("cam01"))) << "parts are not changed";
}

TEST_F(JoinParts, reports_missing_pulses_for_a_node_that_counted_fewer) {
  record("cap02", {"cam03"}, 2);
  join();
  const Verification verified = verify_take(whole_);
  EXPECT_EQ(verified.ledger.commanded, 3);
  EXPECT_EQ(verified.ledger.sensed, 3);
  EXPECT_THAT(verified.ledger.cameras[2].missing, ElementsAre(2));
}

/// A node that crashed may have frames of pulses that it did not write to its own log.
TEST_F(JoinParts, agrees_with_a_node_that_has_a_frame_of_a_pulse_that_it_does_not_know) {
  Ledger ledger{
      .take = "kendo-07", .commanded = 2, .commanded_is_minimum = true, .sensed = 2, .cameras = {}};
  ledger.cameras.push_back(account("cam03", {0, 1, 2}, {}, 2));
  EXPECT_TRUE(save_ledger(part("cap02").ledger(), ledger));
  join();
  std::filesystem::remove(whole_.mesh());
  const Verification verified = verify_take(whole_);
  EXPECT_THAT(verified.disagreements, IsEmpty());
  EXPECT_THAT(verified.ledger.cameras[2].suspect, ElementsAre(2)) << "as its node says";
  EXPECT_THAT(verified.ledger.cameras[2].missing, IsEmpty());
}

/// A frame that its camera marked is not hidden by the ledger.
TEST_F(JoinParts, disagrees_when_a_ledger_lacks_a_suspect_frame) {
  std::filesystem::remove(part("cap02").frames("cam03"));
  {
    EventLogWriter frames(part("cap02").frames("cam03"));
    for (int64_t pulse = 0; pulse < 3; ++pulse) {
      wire::FrameMessage message = test::recorded_frame("cam03", pulse, {4, 2});
      message.frame.label.suspect = pulse == 1;
      EXPECT_TRUE(frames.write(message));
    }
  }
  join();
  std::filesystem::remove(whole_.mesh());
  EXPECT_THAT(verify_take(whole_).disagreements,
              ElementsAre(HasSubstr("cam03.lcmlog: its missing, duplicate or suspect pulses")));
}

TEST_F(JoinParts, links_every_segment_of_the_logs) {
  {
    EventLogWriter later(part("cap01").frames("cam01"), LogOpening::kContinue);
    EXPECT_TRUE(later.write(test::recorded_frame("cam01", 2, {4, 2})));
  }
  const SegmentIndex index{.bytes = 1, .whole_bytes = 1, .events = 1, .damaged_places = 0};
  EXPECT_TRUE(save_segment_index(part("cap01").frames("cam01"), index));
  join();
  EXPECT_EQ(existing_segments(whole_.frames("cam01"))->size(), 2U);
  EXPECT_TRUE(std::filesystem::exists(segment_index_path(whole_.frames("cam01"))));
  EXPECT_THAT(verify_take(whole_).ledger.cameras[0].duplicate, ElementsAre(2));
}

TEST_F(JoinParts, rejects_contradicting_parts) {
  const auto error_message = [&] { return test::message_of<InputError>([&] { join(); }); };
  test::write_text(part("cap02").calib(), "# another rig\n");
  EXPECT_THAT(error_message(), HasSubstr("different calibrations"));
  std::filesystem::remove_all(whole_.folder);
  record("cap02", {"cam01"}, 3);
  EXPECT_THAT(error_message(), HasSubstr("another part has cam01 too"));
}

/// A name was used again for a take without the node that has the earlier take.
TEST_F(JoinParts, rejects_parts_whose_pulses_have_other_times) {
  const auto record_pulses = [&](const std::string& node, std::vector<int64_t> pulses, int hours) {
    std::filesystem::remove(part(node).pulses());
    EventLogWriter log(part(node).pulses());
    for (const int64_t pulse : pulses) {
      wire::PulseMessage message;
      message.pulse = pulse;
      message.edge = from_ns<Realtime>(hours * 3'600'000'000'000 + pulse);
      EXPECT_TRUE(log.write(message));
    }
  };
  record_pulses("cap02", {0, 1, 2}, 1);
  EXPECT_THAT(test::message_of<InputError>([&] { join(); }),
              HasSubstr("cap01 and " + part("cap02").folder.string() +
                        ": are parts of different takes of one name: their pulses have other "
                        "times, pulse 0 differs by 3,600 s"));
  std::filesystem::remove_all(whole_.folder);
  record_pulses("cap02", {3, 4}, 1);
  EXPECT_NO_THROW(join()) << "no pulse in common";
  std::filesystem::remove_all(whole_.folder);
  record("cap03", {"cam04"}, 3);
  record_pulses("cap03", {3, 4}, 2);
  EXPECT_THAT(test::message_of<InputError>([&] {
                join_parts({part("cap01"), part("cap02"), part("cap03")}, whole_);
              }),
              HasSubstr("cap02 and " + part("cap03").folder.string() + ": are parts of different"))
      << "the parts with the pulse";
  std::filesystem::remove_all(whole_.folder);
  test::write_text(part("cap02").pulses(), "not a log, but more than the head of an event");
  EXPECT_NO_THROW(join()) << "a damaged log does not keep the frames out of the copy";
}

TEST_F(JoinParts, rejects_parts_with_symbolic_links) {
  namespace fs = std::filesystem;
  const TakePaths first = part("cap01");
  for (const fs::path& path :
       {first.frames("cam01"), first.background() / "cam01.toml", first.background()}) {
    fs::rename(path, folder_ / "kept");
    fs::create_symlink(folder_ / "kept", path);
    EXPECT_THAT(test::message_of<InputError>([&] { join(); }),
                HasSubstr(path.string() + ": it is a symbolic link"));
    fs::remove(path);
    fs::rename(folder_ / "kept", path);
    fs::remove_all(whole_.folder);
  }
}

TEST_F(JoinParts, uses_the_mesh_file_with_the_most_meshes) {
  reconstruct("recon02", 2);
  reconstruct("recon03", 3);
  reconstruct("recon04", 3);
  const std::vector<TakePaths> parts = {part("recon01"), part("recon02"), part("cap01"),
                                        part("cap02"),   part("recon03"), part("recon04")};
  const MeshPart most = part_with_most_meshes(parts);
  ASSERT_NE(most.part, nullptr);
  EXPECT_EQ(most.part->folder, part("recon03").folder);
  EXPECT_THAT(most.errors, ElementsAre(HasSubstr("recon01/mesh.v3d: is not a mesh file")));
  join_parts(parts, whole_);
  EXPECT_EQ(MeshFileReader(whole_.mesh()).pulses().size(), 3U);
  EXPECT_EQ(part_with_most_meshes({part("cap01")}).part, nullptr);
  const std::vector<TakePaths> unreadable = {part("recon01")};
  EXPECT_EQ(part_with_most_meshes(unreadable).part, unreadable.data()) << "no other has meshes";
}

TEST_F(JoinParts, has_the_proxy_of_its_meshes_and_no_other) {
  reconstruct("recon02", 2);
  reconstruct("recon03", 3);
  test::write_text(part("recon02").proxy(), "of two meshes");
  const std::vector<TakePaths> parts = {part("cap01"), part("cap02"), part("recon02"),
                                        part("recon03")};
  join_parts(parts, whole_);
  EXPECT_FALSE(std::filesystem::exists(whole_.proxy()));
  std::filesystem::remove_all(whole_.folder);
  test::write_text(part("recon03").proxy(), "of three meshes");
  join_parts(parts, whole_);
  EXPECT_EQ(read_file(whole_.proxy()), "of three meshes");
}

TEST_F(JoinParts, has_the_tracked_surfaces_of_its_meshes) {
  test::write_text(part("cap01").motion(), "of cap01");
  join();
  EXPECT_EQ(read_take_text(whole_.motion()), "of cap01") << "no other part has one";
  std::filesystem::remove_all(whole_.folder);
  test::write_text(part("recon01").motion(), "of recon01");
  join();
  EXPECT_EQ(read_take_text(whole_.motion()), "of recon01") << "it has the meshes";
}

TEST_F(JoinParts, has_the_tracked_surfaces_of_meshes_that_were_replaced) {
  test::write_text(part("recon01").earlier_motion(1), "of earlier meshes");
  join();
  EXPECT_EQ(read_file(whole_.earlier_motion(1)), "of earlier meshes");
}

TEST_F(JoinParts, has_the_skeletons_of_its_meshes_and_those_that_only_another_part_has) {
  test::write_text(part("cap01").folder / "skeleton.json", "of cap01");
  test::write_text(part("cap01").folder / "skeleton.performer2.json", "of cap01");
  test::write_text(part("recon01").folder / "skeleton.json", "of recon01");
  join();
  EXPECT_EQ(read_file(whole_.folder / "skeleton.json"), "of recon01");
  EXPECT_EQ(read_file(whole_.folder / "skeleton.performer2.json"), "of cap01");
}

TEST_F(JoinParts, names_the_files_that_are_no_part_of_a_take) {
  test::write_text(part("cap01").folder / "notes.txt", "lens 2");
  test::write_text(part("cap02").folder / "skeleton.json", "{}");
  join();
  EXPECT_THAT(files_not_joined({part("recon01"), part("cap01"), part("cap02")}, whole_),
              ElementsAre("cap01/notes.txt"));
}

TEST_F(JoinParts, leaves_out_and_names_folders_that_are_no_part_of_a_take) {
  for (const char* folder : {"kendo-08", "background/old"}) {
    std::filesystem::create_directories(part("cap01").folder / folder);
    test::write_text(part("cap01").folder / folder / "cam01.lcmlog", "of another take");
  }
  join();
  EXPECT_FALSE(std::filesystem::exists(whole_.folder / "kendo-08"));
  EXPECT_FALSE(std::filesystem::exists(whole_.background() / "old"));
  EXPECT_THAT(files_not_joined({part("recon01"), part("cap01"), part("cap02")}, whole_),
              ElementsAre("cap01/background/old/", "cap01/kendo-08/"));
}

TEST_F(JoinParts, has_the_slates_of_all_nodes) {
  join();
  EXPECT_FALSE(std::filesystem::exists(whole_.slate()));
  std::filesystem::remove_all(whole_.folder);
  test::write_text(part("cap01").slate(), "scene = '12'\nnote = 'slips'\n");
  test::write_text(part("cap02").slate(), "mark = 'circled'\nnote = 'use the second attack'\n");
  join();
  EXPECT_EQ(load_slate(whole_.slate()).text(),
            "scene 12, circled, slips; cap02: use the second attack");
}

TEST_F(JoinParts, reports_a_slate_that_cannot_be_read) {
  const std::vector<TakePaths> parts = {part("cap01"), part("cap02")};
  test::write_text(part("cap01").slate(), "mark = 'good'\n");
  join_parts(parts, whole_);
  EXPECT_EQ(read_file(whole_.slate()), "mark = 'good'\n") << "there is no other";
  EXPECT_THAT(slates_not_joined(parts, whole_), IsEmpty());
  std::filesystem::remove_all(whole_.folder);
  test::write_text(part("cap02").slate(), "mark = 'circled'\n");
  join_parts(parts, whole_);
  EXPECT_EQ(load_slate(whole_.slate()).mark, Mark::kCircled);
  EXPECT_THAT(slates_not_joined(parts, whole_),
              ElementsAre(HasSubstr("cap01/slate.toml: is not copied: ")));
}

TEST_F(JoinParts, has_the_lists_of_repaired_pulses_of_all_nodes) {
  test::write_text(part("recon01").folder / "repaired.recon01.txt", "1\n");
  test::write_text(part("cap02").folder / "repaired.recon02.txt", "2\n");
  join();
  EXPECT_THAT(read_repaired_pulses(whole_), ElementsAre(1, 2));
}

/// A studio of three capture nodes, of which cap00 has the trigger and no camera.
std::string studio_of_three() {
  return test::studio_text(
      {{"cap00", {}}, {"cap01", {"cam01", "cam02"}}, {"cap02", {"cam03", "cam04"}}});
}

TEST_F(JoinParts, names_the_capture_nodes_that_are_left_out) {
  test::write_text(part("cap01").studio(), studio_of_three());
  record("cap00", {}, 3);
  join_parts({part("cap01")}, whole_);
  const Ledger ledger = load_ledger(whole_.ledger());
  const TakeNode cap00{"cap00", {}}, cap02{"cap02", {"cam03", "cam04"}};
  EXPECT_THAT(ledger.absent_nodes, ElementsAre(cap00, cap02));
  EXPECT_FALSE(ledger.complete());
  EXPECT_THAT(ledger.verdict(), testing::EndsWith(", without cap00, cap02 (cam03, cam04)"));
  const Verification verified = verify_take(whole_);
  EXPECT_THAT(verified.disagreements, IsEmpty());
  EXPECT_FALSE(verified.whole());
  EXPECT_THAT(problem_lines(verified.ledger),
              ElementsAre("not in this copy: cap00", "not in this copy: cap02 (cam03, cam04)"));
  EXPECT_THAT(read_take_listing(whole_).absent_nodes, ElementsAre(cap00, cap02));
}

TEST_F(JoinParts, names_no_node_that_has_a_part_or_a_camera_in_a_copy) {
  test::write_text(part("cap01").studio(), studio_of_three());
  record("cap00", {}, 3);
  join_parts({part("cap00"), part("cap01"), part("cap02")}, whole_);
  EXPECT_THAT(load_ledger(whole_.ledger()).absent_nodes, IsEmpty());
  EXPECT_TRUE(load_ledger(whole_.ledger()).complete());
  const TakePaths again{folder_ / "again"};
  join_parts({whole_}, again);
  EXPECT_THAT(load_ledger(again.ledger()).absent_nodes, ElementsAre(TakeNode{"cap00", {}}))
      << "nothing proves that a copy has the part of a node without cameras";
}

TEST_F(JoinParts, rejects_parts_without_a_recording) {
  EXPECT_THAT(test::message_of<InputError>([&] { join_parts({part("recon01")}, whole_); }),
              HasSubstr("no part"));
}

TEST_F(JoinParts, keeps_a_verification_valid_until_a_file_changes) {
  const TakePaths paths = part("cap01");
  EXPECT_FALSE(load_verified(paths));
  EXPECT_TRUE(save_verified(paths, verify_take(paths)));
  const auto verified = load_verified(paths);
  ASSERT_TRUE(verified);
  EXPECT_TRUE(verified->whole);
  EXPECT_THAT(verified->verdict, HasSubstr("kendo-07: complete"));
  EXPECT_TRUE(verified->agrees);
  for (const TakeFile& file : verified->files) {
    const std::string bytes = read_file(paths.folder / file.name);
    EXPECT_EQ(file.checksum,
              checksum({std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size())}))
        << file.name;
  }
  EXPECT_EQ(verified->files.size(), take_file_names(paths)->size() - 1) << "all but verified.toml";
  test::write_text(paths.slate(), "mark = 'circled'\n");
  EXPECT_TRUE(load_verified(paths)) << "the crew may write on a slate";
  EventLogWriter later(paths.frames("cam02"), LogOpening::kContinue);
  EXPECT_TRUE(later.write(test::recorded_frame("cam02", 0, {4, 2})));
  EXPECT_FALSE(load_verified(paths));
}

TEST_F(JoinParts, ignores_a_verification_without_checksums) {
  const TakePaths paths = part("cap01");
  EXPECT_TRUE(save_verified(paths, verify_take(paths)));
  std::string text = read_file(paths.verified());
  const size_t at = text.find("xxh3");
  text.erase(at, text.find('\n', at) - at);
  test::write_text(paths.verified(), text);
  EXPECT_FALSE(load_verified(paths));
}

/// Damage after the recording, in an event number, which no checksum inside the log covers.
TEST_F(JoinParts, keeps_the_checksums_of_the_nodes) {
  for (const std::string node : {"cap01", "cap02"}) {
    Ledger ledger = load_ledger(part(node).ledger());
    for (const CameraLedger& camera : ledger.cameras) {
      ledger.files.push_back(
          read_take_file(part(node), camera.name + ".lcmlog", ReadFrom::kPageCache).value());
    }
    EXPECT_TRUE(save_account(part(node), load_take_info(part(node)), ledger));
  }
  std::string log = read_file(part("cap02").frames("cam03"));
  log[11] = static_cast<char>(log[11] ^ 1);  // in an event number
  test::write_text(part("cap02").frames("cam03"), log);
  test::write_text(part("cap02").background() / "cam03.toml", "CAM03");
  join();
  std::filesystem::remove(whole_.mesh());
  const Verification found = verify_take(whole_);
  EXPECT_THAT(found.disagreements,
              ElementsAre(HasSubstr("cam03.lcmlog: has the checksum"),
                          HasSubstr("background/cam03.toml: has the checksum")));
  EXPECT_THAT(found.notes, IsEmpty());
}

}  // namespace
}  // namespace v3d::take
