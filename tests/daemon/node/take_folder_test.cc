#include "daemon/node/take_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "daemon/node/persisted_command.h"
#include "support/begun_take.h"
#include "support/lock_holder.h"
#include "support/message_of.h"
#include "support/notify_socket.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"
#include "take/take_removal.h"

namespace v3d::node {
namespace {

using testing::HasSubstr;

constexpr char kTemporaryPlate[] = "cam01.mean.png.part-12-1";

class TakeFolderTest : public testing::Test {
 protected:
  TakeFolderTest() {
    studio_.name = "dojo";
    studio_.storage = {.takes = folder_ / "takes",
                       .background = folder_ / "background",
                       .calib = folder_ / "calib.toml"};
    std::filesystem::create_directories(studio_.storage.background);
    test::write_text(studio_.storage.calib, "# the rig\n");
    studio_.path = folder_ / "studio.toml";
    test::write_text(studio_.path, "# the studio\n");
    for (const char* file :
         {"cam01.mean.png", kTemporaryPlate, "cam01.toml", "cam010.toml", "cam02.toml"}) {
      test::write_text(studio_.storage.background / file, file);
    }
    info_ = test::begun_take({"cam01"});
  }

  const test::TemporaryFolder folder_;
  Studio studio_;
  take::TakeInfo info_;
};

TEST_F(TakeFolderTest, begins_with_the_rig_the_studio_and_the_background_of_its_cameras) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  EXPECT_EQ(load_take_info(paths).state, take::TakeState::kRecording);
  EXPECT_EQ(read_file(paths.calib()), "# the rig\n");
  EXPECT_EQ(read_file(paths.studio()), "# the studio\n");
  EXPECT_EQ(read_file(paths.background() / "cam01.mean.png"), "cam01.mean.png");
  EXPECT_TRUE(std::filesystem::exists(paths.background() / "cam01.toml"));
  EXPECT_FALSE(std::filesystem::exists(paths.background() / "cam010.toml"));
  EXPECT_FALSE(std::filesystem::exists(paths.background() / kTemporaryPlate));
  EXPECT_FALSE(std::filesystem::exists(paths.background() / "cam02.toml"));
}

TEST_F(TakeFolderTest, is_rejected_for_a_bad_name_or_an_existing_take) {
  EXPECT_THAT(test::message_of<InputError>([&] { check_new_take(studio_, "../etc"); }),
              HasSubstr("'../etc' cannot name a take"));
  create_take(studio_, info_);
  EXPECT_THAT(test::message_of<InputError>([&] { check_new_take(studio_, "kendo-07"); }),
              HasSubstr("kendo-07 exists already"));
  for (const char* verb : {"check", "background"}) {
    EXPECT_THAT(test::message_of<InputError>([&] { check_new_take(studio_, verb); }),
                testing::HasSubstr(std::string("the name is reserved for v3dctl ") + verb));
  }
  check_new_take(studio_, "kendo-08");
}

TEST_F(TakeFolderTest, names_the_file_that_could_not_be_written) {
  std::filesystem::remove(studio_.storage.calib);
  EXPECT_THAT(test::message_of<InputError>([&] { create_take(studio_, info_); }),
              HasSubstr("calib.toml"));
}

TEST_F(TakeFolderTest, ends_with_its_ledger) {
  create_take(studio_, info_);
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  EXPECT_TRUE(close_take(studio_, info_, ledger));
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  EXPECT_EQ(load_take_info(paths).state, take::TakeState::kComplete);
  EXPECT_EQ(load_take_info(paths).pulses, 3);
  EXPECT_EQ(take::load_ledger(paths.ledger()).commanded, 3);
}

TEST_F(TakeFolderTest, is_closed_with_sound_that_is_too_long_for_a_checksum) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  std::filesystem::create_directory(paths.sound());
  test::write_text(paths.sound() / "cap01.wav", "RF64");
  std::filesystem::resize_file(paths.sound() / "cap01.wav", (uint64_t{4} << 30) + 1);
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  const auto closed = close_take(studio_, info_, ledger);
  ASSERT_TRUE(closed);
  EXPECT_THAT(*closed, testing::IsEmpty());
  const take::Ledger written = take::load_ledger(paths.ledger());
  ASSERT_TRUE(written.file("sound/cap01.wav"));
  EXPECT_EQ(written.file("sound/cap01.wav")->bytes, (int64_t{4} << 30) + 1);
  EXPECT_FALSE(written.file("sound/cap01.wav")->checksum);
}

TEST_F(TakeFolderTest, feeds_the_watchdog_while_its_sound_is_read) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  std::filesystem::create_directory(paths.sound());
  test::write_text(paths.sound() / "cap01.wav", std::string(2 << 20, 's'));
  test::NotifySocket systemd(folder_ / "notify");
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  EXPECT_TRUE(close_take(studio_, info_, ledger));
  EXPECT_GE(systemd.count("WATCHDOG=1"), 1);
}

TEST_F(TakeFolderTest, names_the_cause_when_its_ledger_cannot_be_written_or_lacks_a_checksum) {
  create_take(studio_, info_);
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  std::filesystem::create_symlink("gone", paths.folder / "notes.txt");
  EXPECT_THAT(close_take(studio_, info_, ledger).value(),
              testing::ElementsAre("cannot read " + (paths.folder / "notes.txt").string() +
                                   ": it is a symbolic link, or its path has too many of them"));
  EXPECT_EQ(load_take_info(paths).state, take::TakeState::kComplete);
  EXPECT_EQ(take::load_ledger(paths.ledger()).commanded, 3);
  std::filesystem::remove_all(paths.folder);
  EXPECT_EQ(close_take(studio_, info_, ledger).error().message,
            "cannot write the ledger of kendo-07: cannot list folder " + paths.folder.string() +
                ": No such file or directory");
}

TEST_F(TakeFolderTest, is_recovered_when_a_crash_left_it_open) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  {
    take::EventLogWriter pulses(paths.pulses());
    wire::PulseMessage m;
    EXPECT_TRUE(pulses.write(m));
  }
  EXPECT_TRUE(recover_open_takes(studio_, "cap01", {"cam02"}).empty());  // not of this node
  const auto recovered = recover_open_takes(studio_, "cap01", {"cam01"});
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_EQ(recovered[0].line,
            "recovered take kendo-07: incomplete, 1 cameras x at least 1 pulses, 1 missing, "
            "0 suspect; "
            "cannot read " +
                paths.frames("cam01").string() + ": No such file or directory");
  ASSERT_TRUE(recovered[0].ledger);
  EXPECT_EQ(recovered[0].ledger->take, "kendo-07");
  EXPECT_EQ(load_take_info(paths).state, take::TakeState::kRecovered);
  EXPECT_TRUE(recover_open_takes(studio_, "cap01", {"cam01"}).empty());
}

TEST_F(TakeFolderTest, extends_the_time_for_the_start_while_it_is_recovered) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  wire::FrameMessage message;
  message.frame.camera = "cam01";
  message.frame.image = Image({64, 48}, PixelFormat::kMono8);
  ASSERT_TRUE(take::EventLogWriter(paths.frames("cam01")).write(message));
  test::NotifySocket systemd(folder_ / "notify");
  ASSERT_EQ(recover_open_takes(studio_, "cap01", {"cam01"}).size(), 1U);
  EXPECT_THAT(systemd.received(), HasSubstr("STATUS=recovering kendo-07"));
  EXPECT_THAT(systemd.received(), HasSubstr("EXTEND_TIMEOUT_USEC="));
}

/// A check of the file system after a power cut has moved take.toml to lost+found.
TEST_F(TakeFolderTest, is_named_by_the_recovery_when_it_has_logs_and_no_take_toml) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  take::EventLogWriter(paths.frames("cam01"));
  std::filesystem::remove(paths.info());
  std::filesystem::create_directories(studio_.storage.takes / "kendo-08");  // has nothing
  const std::vector<RecoveredTake> recovered = recover_open_takes(studio_, "cap01", {"cam01"});
  ASSERT_EQ(recovered.size(), 1U);
  EXPECT_FALSE(recovered[0].ledger);
  EXPECT_THAT(recovered[0].line, HasSubstr("kendo-07: has logs and no take.toml"));
}

TEST_F(TakeFolderTest, is_not_recovered_when_its_deletion_was_interrupted) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  take::EventLogWriter(paths.frames("cam01"));
  std::filesystem::rename(paths.folder, studio_.storage.takes / ".deleted-kendo-07");
  EXPECT_THAT(recover_open_takes(studio_, "cap01", {"cam01"}), testing::IsEmpty());
  std::filesystem::rename(studio_.storage.takes / ".deleted-kendo-07", paths.folder);
  EXPECT_THAT(recover_open_takes(studio_, "cap01", {"cam01"}), testing::SizeIs(1));
}

TEST_F(TakeFolderTest, is_recovered_by_a_node_that_has_the_trigger_and_no_camera) {
  create_take(studio_, info_);
  wire::CommandMessage order;
  order.take = info_.name;
  persist_command(studio_, "cap01", order);
  EXPECT_TRUE(recover_open_takes(studio_, "cap02", {}).empty());
  EXPECT_EQ(recover_open_takes(studio_, "cap01", {}).size(), 1U);
  EXPECT_EQ(load_take_info(take_paths(studio_, info_.name)).state, take::TakeState::kRecovered);
}

TEST_F(TakeFolderTest, stays_open_for_the_next_recovery_when_it_is_closed_as_recording) {
  create_take(studio_, info_);
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  EXPECT_TRUE(close_take(studio_, info_, ledger, take::TakeState::kRecording));
  EXPECT_EQ(take::load_ledger(take_paths(studio_, "kendo-07").ledger()).commanded, 3);
  EXPECT_EQ(recover_open_takes(studio_, "cap01", {"cam01"}).size(), 1U);
}

TEST_F(TakeFolderTest, frees_its_name_when_it_could_not_be_armed_unless_another_node_uses_it) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  {
    test::LockHolder other(paths, "cap02");
    quarantine_unarmed_take(paths);
    EXPECT_TRUE(std::filesystem::exists(paths.info()));
  }
  quarantine_unarmed_take(paths);
  check_new_take(studio_, "kendo-07");
  EXPECT_TRUE(std::filesystem::exists(studio_.storage.takes / take::kQuarantineFolder / "kendo-07" /
                                      "take.toml"));
}

TEST_F(TakeFolderTest, is_not_recovered_while_another_process_of_the_node_records_it) {
  create_take(studio_, info_);
  const take::TakePaths paths = take_paths(studio_, "kendo-07");
  test::LockHolder other(paths, "cap01");
  const auto found = recover_open_takes(studio_, "cap01", {"cam01"});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_FALSE(found[0].ledger);
  EXPECT_THAT(found[0].line,
              testing::ContainsRegex("kendo-07.*process [0-9]+ on .* has locked it"));
  EXPECT_EQ(load_take_info(paths).state, take::TakeState::kRecording);
  EXPECT_FALSE(std::filesystem::exists(paths.ledger()));
  EXPECT_THAT(test::message_of<InputError>([&] { lock_take(paths, "cap01"); }),
              HasSubstr("has locked it"));
  other.kill();
  EXPECT_TRUE(recover_open_takes(studio_, "cap01", {"cam01"}).at(0).ledger);
  EXPECT_EQ(load_take_info(paths).state, take::TakeState::kRecovered);
}

}  // namespace
}  // namespace v3d::node
