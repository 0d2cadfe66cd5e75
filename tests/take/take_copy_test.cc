#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/file_size_limit.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"
#include "take/ledger/take_account.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file.h"
#include "take/take_transfer.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

int synced_file_systems = 0;

/// A verified take on a node, and a copy of it in an archive.
class TakeCopy : public testing::Test {
 protected:
  TakeCopy() {
    fs::create_directories(node_.background());
    test::write_text(node_.calib(), "# the rig\n");
    test::write_text(node_.background() / "cam07.toml", "plates");
    TakeInfo info = test::begun_take({"cam07"});
    info.state = TakeState::kComplete;
    info.pulses = 1;
    Ledger ledger{.take = "kendo-07", .commanded = 1, .sensed = 1, .cameras = {}};
    ledger.cameras.push_back(account("cam07", {0}, {}, 1));
    EventLogWriter frames(node_.frames("cam07"));
    EXPECT_TRUE(frames.write(test::recorded_frame("cam07", 0, {64, 48})));
    ledger.files.push_back(frames.file());
    record_pulses(node_, 1);
    EXPECT_TRUE(save_account(node_, info, ledger));
    verify();
    fs::create_directories(archive_.folder.parent_path());
    fs::copy(node_.folder, archive_.folder, fs::copy_options::recursive);
  }

  static void record_pulses(const TakePaths& take, int64_t pulses) {
    fs::remove(take.pulses());
    EventLogWriter log(take.pulses());
    for (int64_t pulse = 0; pulse < pulses; ++pulse) {
      wire::PulseMessage message;
      message.pulse = pulse;
      EXPECT_TRUE(log.write(message));
    }
  }

  /// Replaces the log of the camera by one whose last write failed, and copies the take.
  void record_on_a_full_disk() const {
    fs::remove(node_.frames("cam07"));
    Ledger ledger = load_ledger(node_.ledger());
    EventLogWriter frames(node_.frames("cam07"));
    EXPECT_TRUE(frames.write(test::recorded_frame("cam07", 0, {64, 48})));
    {
      const test::FileSizeLimit limit(static_cast<rlim_t>(frames.bytes() + 100));
      EXPECT_FALSE(frames.write(test::recorded_frame("cam07", 1, {64, 48})));
    }
    EXPECT_TRUE(frames.end());
    EXPECT_TRUE(frames.save_index());
    ledger.files = {frames.file()};
    EXPECT_TRUE(save_account(node_, load_take_info(node_), ledger));
    fs::remove_all(archive_.folder);
    fs::copy(node_.folder, archive_.folder, fs::copy_options::recursive);
  }

  void verify() const { EXPECT_TRUE(save_verified(node_, verify_take(node_))); }

  std::vector<std::string> missing() const {
    return missing_in_copy(node_, load_verified(node_).value(), archive_);
  }

  const test::TemporaryFolder folder_;
  const TakePaths node_{folder_ / "node/kendo-07"};
  const TakePaths archive_{folder_ / "archive/kendo-07"};
};

TEST_F(TakeCopy, accepts_another_slate_and_a_joined_ledger) {
  EXPECT_THAT(missing(), IsEmpty());
  test::write_text(node_.slate(), "mark = 'rejected'\n");
  test::write_text(archive_.slate(), "mark = ''\n");
  // The other node counted a pulse more.
  Ledger other{.take = "kendo-07", .commanded = 2, .sensed = 2, .cameras = {}};
  other.cameras.push_back(account("cam08", {0, 1}, {}, 2));
  ASSERT_TRUE(save_ledger(archive_.ledger(), merge({load_ledger(node_.ledger()), other})));
  EXPECT_THAT(missing(), IsEmpty());
}

TEST_F(TakeCopy, of_a_take_that_ended_on_a_full_disk_is_accepted_and_agrees_with_the_ledger) {
  record_on_a_full_disk();
  EXPECT_THAT(verify_take(node_).disagreements, IsEmpty());
  EXPECT_THAT(verify_take(archive_).disagreements, IsEmpty());
  verify();
  EXPECT_THAT(missing(), IsEmpty());
}

/// Earlier versions listed such a log without the bytes of the failed write.
TEST_F(TakeCopy, is_accepted_with_the_same_bytes_when_a_log_is_longer_than_in_the_ledger) {
  for (const TakePaths& take : {node_, archive_}) {
    test::write_text(take.frames("cam07"), read_file(take.frames("cam07")) + "the rest");
  }
  verify();
  EXPECT_THAT(missing(), IsEmpty());
}

TEST_F(TakeCopy, requires_a_ledger_with_the_same_account_of_each_camera) {
  Ledger ledger = load_ledger(archive_.ledger());
  ledger.cameras[0].missing = {0};
  ASSERT_TRUE(save_ledger(archive_.ledger(), ledger));
  EXPECT_THAT(missing(),
              ElementsAre(HasSubstr("archive/kendo-07/ledger.toml: has another account of cam07")));
  ledger.cameras.clear();
  ASSERT_TRUE(save_ledger(archive_.ledger(), ledger));
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("another account of cam07")));
  test::write_text(archive_.ledger(), "# joined\n");
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("archive/kendo-07/ledger.toml")));
  fs::remove(archive_.ledger());
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("archive/kendo-07/ledger.toml: No such file")));
}

/// The daemon of the node was restarted in the take; the copy has the pulse log of another node.
TEST_F(TakeCopy, may_have_the_pulses_of_several_segments_in_one) {
  {
    EventLogWriter later(node_.pulses(), LogOpening::kContinue);
    wire::PulseMessage message;
    message.pulse = 1;
    EXPECT_TRUE(later.write(message));
  }
  const auto bytes = fs::file_size(node_.pulses());
  EXPECT_TRUE(save_segment_index(
      node_.pulses(), {.bytes = bytes, .whole_bytes = bytes, .events = 1, .damaged_places = 0}));
  verify();
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("pulses.lcmlog: lacks pulses of the original")));
  record_pulses(archive_, 2);
  EXPECT_THAT(missing(), IsEmpty());
  fs::remove(archive_.pulses());
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("pulses.lcmlog: No such file")));
}

TEST_F(TakeCopy, requires_a_slate_that_can_be_read_when_the_original_has_one) {
  test::write_text(node_.slate(), "mark = 'rejected'\n");
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("archive/kendo-07/slate.toml: No such file")));
  test::write_text(archive_.slate(), "mark = 'torn");
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("archive/kendo-07/slate.toml")));
}

TEST_F(TakeCopy, is_synced_with_its_names_before_it_is_compared) {
  synced_file_systems = 0;
  EXPECT_THAT(missing(), IsEmpty());
  EXPECT_EQ(synced_file_systems, 1);
}

TEST_F(TakeCopy, reports_a_file_with_a_changed_bit) {
  std::string log = read_file(archive_.frames("cam07"));
  log.back() = static_cast<char>(log.back() ^ 1);
  test::write_text(archive_.frames("cam07"), log);
  EXPECT_THAT(missing(), ElementsAre(testing::AllOf(HasSubstr("archive/kendo-07/cam07.lcmlog: has"),
                                                    HasSubstr("the original"))));
  fs::remove(archive_.background() / "cam07.toml");
  EXPECT_THAT(missing(), testing::Contains(HasSubstr("background/cam07.toml: No such file")));
}

TEST_F(TakeCopy, rejects_the_original_itself) {
  EXPECT_THAT(missing_in_copy(node_, load_verified(node_).value(), node_),
              testing::Contains(HasSubstr("is the file itself, not a copy")));
  fs::remove(archive_.calib());
  fs::create_hard_link(node_.calib(), archive_.calib());
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("calib.toml: is the file itself, not a copy")));
}

TEST_F(TakeCopy, accepts_pulses_and_meshes_of_a_node_with_more) {
  record_pulses(archive_, 2);
  EXPECT_THAT(missing(), IsEmpty());
  record_pulses(archive_, 0);
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("pulses.lcmlog: lacks pulses")));
  record_pulses(archive_, 1);
  const auto reconstruct = [](const TakePaths& take, std::vector<int64_t> pulses) {
    fs::remove(take.mesh());
    MeshFileWriter file(take.mesh());
    for (const int64_t pulse : pulses) EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>{1}));
  };
  reconstruct(node_, {0});
  EXPECT_FALSE(load_verified(node_)) << "its meshes are new";
  verify();
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("mesh.v3d: No such file")));
  reconstruct(archive_, {0, 1});
  EXPECT_THAT(missing(), IsEmpty());
  reconstruct(archive_, {1});
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("mesh.v3d: has")));
}

TEST_F(TakeCopy, needs_the_proxy_of_the_original_with_its_pulses) {
  const auto make_proxy = [](const TakePaths& take, std::vector<int64_t> pulses, uint8_t byte) {
    fs::remove(take.proxy());
    MeshFileWriter file(take.proxy());
    for (const int64_t pulse : pulses) EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>{byte}));
  };
  make_proxy(node_, {0, 1}, 1);
  verify();
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("proxy.v3d: No such file")));
  make_proxy(archive_, {0}, 1);
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("proxy.v3d: has")));
  make_proxy(archive_, {0, 1}, 2);
  EXPECT_THAT(missing(), IsEmpty());
}

TEST_F(TakeCopy, is_not_enough_while_a_mesh_of_the_original_cannot_be_read) {
  const auto reconstruct = [](const TakePaths& take, const std::vector<int64_t>& pulses) {
    MeshFileWriter file(take.mesh());
    for (const int64_t pulse : pulses) EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>{1}));
  };
  reconstruct(node_, {0, 1});
  verify();
  reconstruct(archive_, {1});
  const test::UnreadableByte bad(16 + 24, node_.folder);  // the payload of pulse 0
  EXPECT_THAT(missing(),
              ElementsAre("cannot read " + node_.mesh().string() + ": Input/output error",
                          HasSubstr("archive/kendo-07/mesh.v3d: has")));
}

TEST_F(TakeCopy, needs_a_skeleton_like_the_original_which_a_command_may_have_replaced) {
  test::write_text(node_.folder / "skeleton.json", "{}");
  verify();
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("skeleton.json: No such file")));
  test::write_text(archive_.folder / "skeleton.json", "{ }");
  EXPECT_THAT(missing(), IsEmpty());
}

TEST_F(TakeCopy, rejects_another_take_and_a_missing_camera) {
  TakeInfo info = load_take_info(archive_);
  info.name = "kendo-08";
  info.cameras = {"cam01"};
  EXPECT_TRUE(save_take_info(archive_, info));
  EXPECT_THAT(missing(), ElementsAre(HasSubstr("is a copy of take kendo-08, not of kendo-07"),
                                     HasSubstr("has no camera 'cam07'")));
  fs::remove(archive_.info());
  EXPECT_THROW(missing(), InputError);
}

}  // namespace
}  // namespace v3d::take

/// Replaces that of the C library, to count its calls.
extern "C" int syncfs(int fd) {
  ++v3d::take::synced_file_systems;
  return static_cast<int>(syscall(SYS_syncfs, fd));
}
