#include "trace_writer.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdlib>
#include <utility>

#include "fault_plan.h"

namespace v3d::test {
namespace {

FaultPlan& plan() { return FaultPlan::of_process(); }

uint64_t inode_of(int fd) {
  struct stat status {};
  return syscall(SYS_fstat, fd, &status) == 0 ? status.st_ino : 0;
}

uint64_t inode_of(const std::string& path) {
  struct stat status {};
  const long failed = syscall(SYS_newfstatat, AT_FDCWD, path.c_str(), &status, AT_SYMLINK_NOFOLLOW);
  return failed == 0 ? status.st_ino : 0;
}

struct Record {
  Change change;
  uint64_t file = 0;
  uint64_t offset = 0;
  std::string path = {}, other = {};
  std::string bytes = {};
};

void append(const Record& record) {
  const ChangeHead head{record.change,
                        static_cast<uint32_t>(record.path.size()),
                        static_cast<uint32_t>(record.other.size()),
                        record.file,
                        record.offset,
                        record.bytes.size()};
  std::string text(reinterpret_cast<const char*>(&head), sizeof head);
  text += record.path + record.other + record.bytes;
  if (syscall(SYS_write, plan().trace_fd(), text.data(), text.size()) !=
      static_cast<long>(text.size())) {
    std::abort();  // a trace with a gap is of no use
  }
}

}  // namespace

TraceLock::TraceLock() {
  while (plan().traces() && plan().report()->trace_lock.exchange(1) != 0) sched_yield();
}
TraceLock::~TraceLock() {
  if (plan().traces()) plan().report()->trace_lock = 0;
}

bool exists(const std::string& path) { return inode_of(path) != 0; }

void record_write(int fd, const std::string& path, std::string bytes, off_t offset) {
  if (!plan().traces()) return;
  if (plan().is_marks(path)) append({.change = Change::kMark, .bytes = std::move(bytes)});
  if (!plan().is_below(path) || bytes.empty()) return;
  if (offset < 0) offset = syscall(SYS_lseek, fd, 0, SEEK_CUR) - static_cast<off_t>(bytes.size());
  append({.change = Change::kWrite,
          .file = inode_of(fd),
          .offset = static_cast<uint64_t>(offset),
          .bytes = std::move(bytes)});
}

void record_sync(int fd) {
  if (plan().traces()) append({.change = Change::kSync, .file = inode_of(fd)});
}

void record_sync_of_all() {
  if (plan().traces()) append({.change = Change::kSyncAll});
}

void record_length(int fd, off_t length) {
  if (!plan().traces()) return;
  append(
      {.change = Change::kTruncate, .file = inode_of(fd), .offset = static_cast<uint64_t>(length)});
}

void record_names(Change change, const std::string& path, const std::string& other) {
  if (!plan().traces() || !(plan().is_below(path) || plan().is_below(other))) return;
  append({.change = change,
          .file = inode_of(other.empty() ? path : other),
          .path = path,
          .other = other});
}

}  // namespace v3d::test
