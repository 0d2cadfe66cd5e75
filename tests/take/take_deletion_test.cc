#include "take/take_deletion.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <functional>
#include <memory>

#include "base/core/error.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/lock_holder.h"
#include "support/open_faults.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_account.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kOtherMount = "/other-mount/";  ///< paths that stat() sees on another device
std::string unreadable;                               ///< path that stat() cannot read; empty: none

/// The verified takes kendo-07 and kendo-08 of a node, and their copies in an archive.
class TakeDeletions : public testing::Test {
 protected:
  TakeDeletions() {
    fs::create_directories(archive_);
    for (const char* name : {"kendo-07", "kendo-08"}) record(name);
  }

  void record(const std::string& name) const {
    const TakePaths take{node_ / name};
    fs::create_directories(take.background());
    test::write_text(take.calib(), "# the rig\n");
    TakeInfo info = test::begun_take({"cam07"});
    info.name = name;
    info.state = TakeState::kComplete;
    info.pulses = 1;
    Ledger ledger{.take = name, .commanded = 1, .sensed = 1, .cameras = {}};
    ledger.cameras.push_back(account("cam07", {0}, {}, 1));
    EventLogWriter frames(take.frames("cam07"));
    EXPECT_TRUE(frames.write(test::recorded_frame("cam07", 0, {64, 48})));
    ledger.files.push_back(frames.file());
    EventLogWriter pulses(take.pulses());
    EXPECT_TRUE(pulses.write(wire::PulseMessage()));
    EXPECT_TRUE(save_account(take, info, ledger));
    fs::copy(take.folder, archive_ / name, fs::copy_options::recursive);
    for (const TakePaths& verified : {take, TakePaths{archive_ / name}}) {
      EXPECT_TRUE(save_verified(verified, verify_take(verified)));
    }
  }

  std::vector<TakePaths> on_node() const { return {{node_ / "kendo-07"}, {node_ / "kendo-08"}}; }

  /// Empty when `call` throws nothing.
  static std::string error_of(const std::function<void()>& call) {
    try {
      call();
    } catch (const InputError& error) {
      return error.what();
    }
    return {};
  }
  std::string error_of_construction(const std::vector<TakePaths>& takes,
                                    const fs::path& copies) const {
    return error_of([&] { TakeDeletion deletion(takes, copies); });
  }
  /// The error of the comparison, or of the removal of kendo-07 when `change` happens between
  /// comparison and removal.
  std::string error_after(const std::function<void()>& change) const {
    return error_of([&] {
      TakeDeletion deletion(on_node(), archive_);
      deletion.compare([](const std::string& line) { ADD_FAILURE() << line; });
      change();
      deletion.remove(on_node().front());
    });
  }

  const test::TemporaryFolder folder_;
  const fs::path node_ = folder_ / "node", archive_ = folder_ / "archive";
};

TEST_F(TakeDeletions, delete_takes_with_their_locks_and_leave_only_the_copies) {
  {
    TakeDeletion deletion(on_node(), archive_);
    deletion.compare([](const std::string& line) { ADD_FAILURE() << line; });
    EXPECT_TRUE(fs::exists(archive_ / "kendo-07/.deletion"));
    for (const TakePaths& take : on_node()) deletion.remove(take);
  }
  EXPECT_TRUE(fs::is_empty(node_));
  EXPECT_TRUE(fs::exists(archive_ / "kendo-07/cam07.lcmlog"));
  EXPECT_FALSE(fs::exists(archive_ / "kendo-07/.deletion"));
}

TEST_F(TakeDeletions, need_the_copy_and_name_what_it_lacks) {
  fs::remove(archive_ / "kendo-08/calib.toml");
  std::string report;
  const auto compare = [&] {
    TakeDeletion(on_node(), archive_).compare([&](const std::string& line) { report += line; });
  };
  EXPECT_THAT(error_of(compare), HasSubstr("kendo-08 is not deleted: its copy in "));
  EXPECT_THAT(report, HasSubstr("kendo-08/calib.toml: No such file"));
  EXPECT_THAT(error_of_construction(on_node(), folder_ / "none"),
              HasSubstr("node/kendo-07 is not deleted: " + (folder_ / "none").string() +
                        " has no copy of it"));
}

/// Two operators: one deletes on the node, one in the archive, and each names the other's copy.
TEST_F(TakeDeletions, of_both_copies_at_the_same_time_are_rejected) {
  std::vector<TakePaths> in_archive{{archive_ / "kendo-07"}};
  test::LockHolder first([&] { return std::make_unique<TakeDeletion>(on_node(), archive_); });
  EXPECT_THAT(error_of_construction(in_archive, node_),
              AllOf(HasSubstr("archive/kendo-07/.deletion: process " + std::to_string(first.pid())),
                    HasSubstr(" deletes this take, or needs it as a copy; if that process has "
                              "ended, remove this file")));
  EXPECT_THAT(error_of_construction(in_archive, {}), HasSubstr("needs it as a copy"));
  first.kill();
  EXPECT_TRUE(fs::exists(archive_ / "kendo-07/.deletion")) << "it was killed";
  EXPECT_EQ(error_of_construction(in_archive, node_), "") << "its file does not exclude this PC";
  EXPECT_FALSE(fs::exists(archive_ / "kendo-07/.deletion"));
}

/// The lock of a process whose flock() this PC does not see, as on the server of a mount.
TEST_F(TakeDeletions, are_rejected_while_a_process_on_another_pc_needs_the_take) {
  test::write_text(archive_ / "kendo-07/.deletion", "process 1 on cap09\nboot other\nlock 1\n");
  EXPECT_THAT(error_of_construction(on_node(), archive_),
              HasSubstr("archive/kendo-07/.deletion: process 1 on cap09 deletes this take"));
  test::write_text(archive_ / "kendo-07/.deletion", "");
  EXPECT_THAT(error_of_construction(on_node(), archive_),
              HasSubstr("archive/kendo-07/.deletion: another process deletes this take"));
  EXPECT_FALSE(fs::exists(node_ / "kendo-07/.deletion")) << "no lock is left";
}

TEST_F(TakeDeletions, are_rejected_while_the_copy_is_locked_for_recording_or_recovery) {
  const test::LockHolder holder(TakePaths{archive_ / "kendo-07"}, "cap01");
  EXPECT_THAT(error_of_construction(on_node(), archive_), HasSubstr("has locked it"));
}

TEST_F(TakeDeletions, keep_a_take_whose_copy_has_changed_since_it_was_read) {
  EXPECT_THAT(error_after([&] { test::write_text(archive_ / "kendo-07/calib.toml", "# a rig\n"); }),
              HasSubstr("kendo-07 is not deleted: it or its copy in "));
  EXPECT_TRUE(fs::exists(node_ / "kendo-07/cam07.lcmlog"));
}

TEST_F(TakeDeletions, keep_a_take_whose_copy_was_moved_since_it_was_read) {
  EXPECT_THAT(error_after([&] { fs::rename(archive_, folder_ / "unplugged"); }),
              HasSubstr("kendo-07 is not deleted: it or its copy in "));
  EXPECT_TRUE(fs::exists(node_ / "kendo-07/cam07.lcmlog"));
}

TEST_F(TakeDeletions, keep_a_take_and_name_the_file_of_its_copy_that_cannot_be_read_any_more) {
  EXPECT_THAT(error_after([&] { unreadable = archive_ / "kendo-07/calib.toml"; }),
              AllOf(HasSubstr("archive/kendo-07/calib.toml: "), HasSubstr("Input/output error")));
  unreadable.clear();
  EXPECT_TRUE(fs::exists(node_ / "kendo-07/cam07.lcmlog"));
}

TEST_F(TakeDeletions, keep_a_take_that_was_circled_since_its_copy_was_read) {
  EXPECT_THAT(
      error_after([&] { test::write_text(node_ / "kendo-07/slate.toml", "mark = 'circled'\n"); }),
      HasSubstr("kendo-07 is circled"));
  EXPECT_TRUE(fs::exists(node_ / "kendo-07/cam07.lcmlog"));
}

TEST_F(TakeDeletions, delete_a_take_whose_copy_got_a_note_and_a_skeleton_since_it_was_read) {
  EXPECT_EQ(error_after([&] {
              test::write_text(archive_ / "kendo-07/slate.toml", "note = 'the best'\n");
              test::write_text(archive_ / "kendo-07/skeleton.json", "{}");
            }),
            "");
  EXPECT_FALSE(fs::exists(node_ / "kendo-07"));
}

/// The crew wrote on the slate of the node after the take had been collected.
TEST_F(TakeDeletions, keep_a_take_whose_slate_has_a_text_that_the_copy_lacks) {
  const auto note = [](const fs::path& takes, const std::string& text) {
    test::write_text(takes / "kendo-07/slate.toml", "scene = '12'\nnote = '" + text + "'\n");
  };
  note(archive_, "slips");
  note(node_, "use the second attack");
  EXPECT_THAT(error_after([] {}), HasSubstr("kendo-07 is not deleted: the slate of its copy in "));
  note(archive_, "slips; use the second attack");
  EXPECT_THAT(error_after([&] { note(node_, "use the first attack"); }),
              HasSubstr(" lacks \"use the first attack\"; write it there, or remove it here"));
  note(node_, "use the second attack");
  EXPECT_EQ(error_after([] {}), "");
}

TEST(DeletionLocks, exclude_this_process_and_leave_no_file) {
  const test::TemporaryFolder folder;
  const TakePaths take{folder.path()};
  {
    const auto lock = DeletionLock::acquire(take);
    ASSERT_TRUE(lock) << lock.error().message;
    EXPECT_TRUE(lock->excludes());
    EXPECT_EQ(DeletionLock::acquire(take).error().code, EDEADLK);
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
  EXPECT_EQ(DeletionLock::acquire({folder / "gone"}).error().code, ENOENT);
}

TEST(DeletionLocks, do_not_remove_the_file_of_a_new_take_with_the_same_name) {
  const test::TemporaryFolder folder;
  const TakePaths take{folder / "take"};
  fs::create_directories(take.folder);
  {
    const auto lock = DeletionLock::acquire(take);
    fs::rename(take.folder, folder / "deleted");
    fs::create_directories(take.folder);
    test::write_text(take.folder / ".deletion", "");
  }
  EXPECT_TRUE(fs::exists(take.folder / ".deletion"));
}

TEST(DeletionLocks, do_not_exclude_where_no_file_can_be_created) {
  const TakePaths read_only{"/sys/kernel"};
  if (!fs::exists(read_only.folder)) GTEST_SKIP() << "no sysfs";
  const auto lock = DeletionLock::acquire(read_only);
  ASSERT_TRUE(lock) << lock.error().message;
  EXPECT_FALSE(lock->excludes());
}

/// A second mount of the folder of takes, as NFS of the PC's own export: the same files with
/// another device number.
TEST_F(TakeDeletions, are_rejected_with_the_take_itself_through_another_mount_as_the_copy) {
  const fs::path mount = folder_ / "other-mount";
  fs::create_directories(mount);
  fs::create_directory_symlink(node_, mount / "takes");
  ASSERT_FALSE(fs::equivalent(node_ / "kendo-07", mount / "takes/kendo-07"));
  EXPECT_THAT(error_of_construction(on_node(), mount / "takes"),
              HasSubstr("node/kendo-07 is not deleted: " + (mount / "takes/kendo-07").string() +
                        " is the take itself by another path, not a copy"));
}

/// The disk is full, which is when takes are deleted: the lock that shows this cannot be created.
TEST_F(TakeDeletions, are_rejected_with_the_take_itself_as_the_copy_also_on_a_full_disk) {
  const fs::path mount = folder_ / "other-mount";
  fs::create_directories(mount);
  fs::create_directory_symlink(node_, mount / "takes");
  const test::FullDisk full(folder_.path());
  EXPECT_THAT(error_of_construction(on_node(), mount / "takes"),
              AllOf(HasSubstr("cannot lock "), HasSubstr("node/kendo-07/.deletion: No space left"),
                    HasSubstr("; remove a file that belongs to no take from this disk, and ")));
}

/// Another command may delete the copy, as one that needs no copy.
TEST_F(TakeDeletions, are_rejected_when_the_disk_of_the_copy_has_no_room_for_its_lock) {
  const test::FullDisk full(archive_);
  EXPECT_THAT(error_of_construction(on_node(), archive_),
              HasSubstr("archive/kendo-07/.deletion: No space left"));
  EXPECT_FALSE(fs::exists(node_ / "kendo-07/.deletion")) << "no lock is left";
}

TEST_F(TakeDeletions, make_room_on_a_full_disk_where_no_copy_is_needed) {
  const test::FullDisk full(folder_.path());
  TakeDeletion deletion(on_node(), {});
  for (const TakePaths& take : on_node()) deletion.remove(take);
  EXPECT_TRUE(fs::is_empty(node_));
}

}  // namespace
}  // namespace v3d::take

/// Replaces that of the C library: another device for files below kOtherMount, EIO for
/// `unreadable`.
extern "C" int stat(const char* path, struct stat* status) {
  if (v3d::take::unreadable == path) {
    errno = EIO;
    return -1;
  }
  const auto result = static_cast<int>(syscall(SYS_newfstatat, AT_FDCWD, path, status, 0));
  if (result == 0 &&
      std::string_view(path).find(v3d::take::kOtherMount) != std::string_view::npos) {
    ++status->st_dev;
  }
  return result;
}
