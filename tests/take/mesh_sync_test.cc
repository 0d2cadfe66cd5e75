// Periodic sync of mesh files. A replacement of fsync() counts calls, and fails or blocks on
// request.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"

namespace v3d {
namespace {

using testing::HasSubstr;

/// Replacement of fsync() for regular files during its lifetime.
class FsyncHook {
 public:
  FsyncHook() { current() = this; }
  ~FsyncHook() { current() = nullptr; }
  FsyncHook(const FsyncHook&) = delete;
  FsyncHook& operator=(const FsyncHook&) = delete;

  static std::atomic<FsyncHook*>& current() {
    static std::atomic<FsyncHook*> hook = nullptr;
    return hook;
  }

  /// The result of the call; -1 with errno after fail_next(). Blocks while held, at most ten
  /// seconds.
  int on_sync(int fd) {
    std::unique_lock lock(mutex_);
    ++syncs_;
    thread_ = std::this_thread::get_id();
    changed_.notify_all();
    const bool is_released =
        changed_.wait_for(lock, std::chrono::seconds(10), [this] { return !holds_; });
    is_stuck_ = is_stuck_ || !is_released;
    if (!std::exchange(fails_, false)) return static_cast<int>(syscall(SYS_fsync, fd));
    errno = EIO;
    return -1;
  }

  /// Waits for the given number of calls. False when there were fewer within ten seconds.
  bool wait_for(int syncs) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(10), [&] { return syncs_ >= syncs; });
  }
  void hold(bool holds) {
    const std::lock_guard lock(mutex_);
    holds_ = holds;
    changed_.notify_all();
  }
  void fail_next() {
    const std::lock_guard lock(mutex_);
    fails_ = true;
  }
  /// True when a call was blocked for ten seconds.
  bool is_stuck() {
    const std::lock_guard lock(mutex_);
    return is_stuck_;
  }
  std::thread::id thread() const { return thread_; }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int syncs_ = 0;
  bool holds_ = false;
  bool fails_ = false;
  bool is_stuck_ = false;
  std::thread::id thread_;
};

const std::vector<uint8_t> kMesh(1000, 7);

class MeshSync : public testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  FsyncHook hook_;
  MeshFileWriter file_{folder_ / "mesh.v3d"};
};

TEST_F(MeshSync, runs_periodically_during_appends_in_another_thread) {
  const MonotonicInstant begin = Monotonic::now();
  EXPECT_TRUE(file_.append(0, kMesh));
  ASSERT_TRUE(hook_.wait_for(1));
  EXPECT_LT(Monotonic::now() - begin, std::chrono::milliseconds(1900))
      << "one second, plus tolerance";
  EXPECT_NE(hook_.thread(), std::this_thread::get_id());
  EXPECT_TRUE(file_.append(1, kMesh));
  EXPECT_TRUE(hook_.wait_for(2)) << "again in the next second";
}

TEST_F(MeshSync, does_not_block_append) {
  hook_.hold(true);
  EXPECT_TRUE(file_.append(0, kMesh));
  EXPECT_TRUE(hook_.wait_for(1)) << "the sync is blocked";
  EXPECT_TRUE(file_.append(1, kMesh));
  EXPECT_FALSE(hook_.is_stuck()) << "append() waited for the sync";
  hook_.hold(false);
  EXPECT_TRUE(file_.close());
}

TEST_F(MeshSync, reports_an_error_once_by_append_and_by_close) {
  hook_.fail_next();
  EXPECT_TRUE(file_.append(0, kMesh));
  int64_t pulse = 0;
  const auto is_reported = [&] { return !file_.append(++pulse, kMesh); };
  ASSERT_TRUE(test::becomes_true(is_reported, test::within(10)));
  EXPECT_TRUE(file_.append(++pulse, kMesh));
  const io::Status closed = file_.close();
  ASSERT_FALSE(closed);
  EXPECT_THAT(closed.error().message, HasSubstr("cannot sync"));
  EXPECT_EQ(MeshFileReader(folder_ / "mesh.v3d").pulses().back(), pulse);
}

}  // namespace
}  // namespace v3d

/// Replaces fsync() of the C library in this program.
extern "C" int fsync(int fd) {
  v3d::FsyncHook* const hook = v3d::FsyncHook::current();
  struct stat status {};
  const bool is_file = fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  return hook != nullptr && is_file ? hook->on_sync(fd) : static_cast<int>(syscall(SYS_fsync, fd));
}
