#include "fault_plan.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <cstring>

#include "power_cut.h"

namespace v3d::test {
namespace {

std::string_view environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// Opens a file without the intercepted open().
int open_raw(const char* path, int flags) {
  return static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, 0644));
}

/// Appends to a file without the intercepted calls. Aborts the process on failure.
void append_raw(const char* path, const std::string& text) {
  const int fd = open_raw(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC);
  const long written = syscall(SYS_write, fd, text.data(), text.size());
  if (written != static_cast<long>(text.size())) std::abort();
  close(fd);
}

/// Moves `fd` to a number from 900: some programs close all descriptors below a limit.
int move_to_high_number(int fd) {
  constexpr int kHigh = 900;
  const int high = fcntl(fd, F_DUPFD_CLOEXEC, kHigh);
  close(fd);
  return high;
}

FaultReport* map_report(const char* path) {
  const int fd = open_raw(path, O_RDWR | O_CLOEXEC);
  if (fd < 0) return nullptr;
  void* const memory = reinterpret_cast<void*>(
      syscall(SYS_mmap, nullptr, sizeof(FaultReport), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0));
  close(fd);
  return memory == MAP_FAILED ? nullptr : static_cast<FaultReport*>(memory);
}

int error_number(std::string_view name) {
  if (name == "ENOSPC") return ENOSPC;
  if (name == "EMFILE") return EMFILE;
  if (name == "EINTR") return EINTR;
  if (name == "ENOLCK") return ENOLCK;
  return EIO;
}

/// Empty when the target is no path: "anon_inode:[eventfd]", "socket:[17]".
std::string read_link(const char* path) {
  std::array<char, 4096> target{};
  const long length = syscall(SYS_readlinkat, AT_FDCWD, path, target.data(), target.size());
  if (length <= 0 || target[0] != '/') return {};
  return {target.data(), static_cast<size_t>(length)};
}

}  // namespace

FaultPlan& FaultPlan::of_process() {
  static FaultPlan plan;
  return plan;
}

FaultPlan::FaultPlan() {
  const std::string_view program = environment("V3D_FAULT_PROGRAM");
  if (!program.empty() && program != program_invocation_short_name) return;
  const std::string_view report = environment("V3D_FAULT_REPORT");
  if (report.empty()) return;
  report_ = map_report(report.data());
  if (report_ == nullptr) return;
  prefix_ = environment("V3D_FAULT_PREFIX");
  marks_ = environment("V3D_FAULT_MARKS");
  call_ = fault_call(environment("V3D_FAULT_CALL"));
  const std::string number(environment("V3D_FAULT_NUMBER"));
  number_ = static_cast<uint32_t>(std::strtoul(number.c_str(), nullptr, 10));
  lasts_ = environment("V3D_FAULT_LASTS") == "1";
  const std::string_view kind = environment("V3D_FAULT_KIND");
  kind_ = kind == "SHORT"       ? FaultKind::kShort
          : kind == "POWER_CUT" ? FaultKind::kPowerCut
                                : FaultKind::kError;
  error_ = error_number(kind);
  const std::string_view trace = environment("V3D_FAULT_TRACE");
  if (!trace.empty()) {
    trace_ = move_to_high_number(open_raw(trace.data(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC));
  }
}

bool FaultPlan::is_below(const std::string& path) const {
  return report_ != nullptr && !prefix_.empty() && path.starts_with(prefix_) &&
         (path.size() == prefix_.size() || path[prefix_.size()] == '/');
}

bool FaultPlan::is_hit(uint32_t number) const {
  return number == number_ || (lasts_ && number_ > 0 && number > number_);
}

FaultKind FaultPlan::next(std::string_view call, const std::string& path) {
  return next(call, path, path);
}

FaultKind FaultPlan::next(std::string_view call, const std::string& a, const std::string& b) {
  if (!is_below(a) && !is_below(b)) return FaultKind::kNone;
  const size_t family = fault_call(call);
  const uint32_t number = ++report_->calls.at(family);
  if (family != call_ || !is_hit(number)) return FaultKind::kNone;
  std::strncpy(report_->fired_on.data(), a.c_str(), report_->fired_on.size() - 1);
  ++report_->fired;
  if (kind_ == FaultKind::kPowerCut) {
    append_raw(marks_.c_str(), std::string(kPowerCutMark) + "\n");
    if (!shut_down(prefix_.c_str())) std::abort();
    kill(getpid(), SIGKILL);
  }
  return kind_;
}

std::string absolute_path(int at, const char* path) {
  if (path == nullptr) return "";
  if (path[0] == '/') return path;
  const std::string folder = at == AT_FDCWD ? read_link("/proc/self/cwd") : path_of(at);
  return folder + "/" + path;
}

std::string path_of(int fd) {
  if (fd < 0) return "";
  std::array<char, 32> link{"/proc/self/fd/"};
  std::to_chars(link.data() + std::strlen(link.data()), link.end(), fd);
  return read_link(link.data());
}

}  // namespace v3d::test
