#include "daemon/captured/take_disk.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/unique_fd.h"
#include "take/take_removal.h"

namespace v3d::captured {
namespace {

namespace fs = std::filesystem;

constexpr double kFiveMinutes = 300;
/// Warn while a take is recorded and the disk has space for less than this.
constexpr double kEnoughSeconds = 60;
/// Space for take.toml and a ledger that lists every pulse of 15 cameras for 20 minutes.
constexpr int64_t kLedgerBytes = 4 << 20;

std::string format_duration(double seconds) {
  if (seconds < 120) return format_count(static_cast<int64_t>(seconds)) + " s";
  return format_count(static_cast<int64_t>(seconds / 60)) + " min";
}

double bytes_besides_frames(const DiskDemand& demand) {
  return demand.bytes_in_flight() + static_cast<double>(kLedgerBytes);
}

/// Advice when the disk has less space than needed.
std::string what_fits(const DiskDemand& demand, double free_bytes) {
  if (demand.bytes_per_pulse <= 0) return "make room: v3dctl takes";
  const double room = free_bytes - bytes_besides_frames(demand);
  const auto pulses = static_cast<int64_t>(std::max(0.0, room) / demand.bytes_per_pulse);
  if (pulses < 1) return "make room: v3dctl takes";
  return "room for " + format_duration(static_cast<double>(pulses) / demand.rate_hz) +
         ": arm with --pulses " + std::to_string(pulses) + ", or make room: v3dctl takes";
}

/// Creates the file that reserves space for the ledger. Returns 0 or an errno.
int reserve_room(const fs::path& path) {
  // O_NONBLOCK: a FIFO of that name fails and does not block.
  constexpr int kFlags = O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  const io::UniqueFd fd(io::uninterrupted([&] { return ::open(path.c_str(), kFlags, 0644); }));
  if (!fd) return errno;
  int error = EINTR;
  while (error == EINTR) error = posix_fallocate(fd.get(), 0, kLedgerBytes);
  return error;
}

}  // namespace

std::string space_shortage(const DiskDemand& demand, double free_bytes) {
  const double seconds =
      demand.pulses ? static_cast<double>(*demand.pulses) / demand.rate_hz : kFiveMinutes;
  const double frames = demand.bytes_per_pulse * seconds * demand.rate_hz;
  if (frames + bytes_besides_frames(demand) <= free_bytes) return "";
  const std::string length =
      demand.pulses ? format_count(*demand.pulses) + " pulses" : format_duration(seconds);
  return "needs " + format_bytes(frames) + " for " + length + ", " + format_bytes(free_bytes) +
         " free (" + what_fits(demand, free_bytes) + ")";
}

std::string folder_fault(const fs::path& takes) {
  const auto type = io::type_of(takes);
  if (!type) return type.error().message;
  if (*type != fs::file_type::directory) {
    return takes.string() + ": no such folder; is its disk mounted?";
  }
  if (access(takes.c_str(), W_OK) == 0) return "";
  return errno_message("cannot record into " + takes.string());
}

void check_disk(const fs::path& takes, const DiskDemand& demand) {
  if (const std::string fault = folder_fault(takes); !fault.empty()) throw InputError(fault);
  const uint64_t free = io::value_or_throw(io::free_bytes(takes));
  const std::string lack = space_shortage(demand, static_cast<double>(free));
  if (!lack.empty()) throw InputError(takes.string() + ": " + lack);
}

TakeDisk::TakeDisk(take::TakePaths take, const DiskDemand& demand, FreeSpaceReader free_bytes)
    : take_(std::move(take)), demand_(demand), free_bytes_(std::move(free_bytes)) {
  const int error = reserve_room(take_.reserve());
  if (error == 0) return;
  take::remove_working_file(take_.reserve());
  errno = error;
  throw InputError(errno_message("cannot reserve space for the ledger in " + takes()));
}

TakeDisk::~TakeDisk() { take::remove_working_file(take_.reserve()); }

void TakeDisk::expect(double bytes_per_pulse) {
  demand_.bytes_per_pulse = std::max(demand_.bytes_per_pulse, bytes_per_pulse);
}

io::Result<bool> TakeDisk::is_gone() const {
  return io::type_of(take_.info()).map([](fs::file_type type) {
    return type == fs::file_type::not_found;
  });
}

std::string TakeDisk::stop_reason(const DiskErrors& errors) const {
  if (errors.failed > 0) return "cannot write frames to " + takes() + ": it is full or broken";
  // Without the folder, the free space would be that of another disk; warning() reports it.
  if (is_gone().value_or(false)) return "";
  const io::Result<uint64_t> free = free_bytes_(take_.folder);
  if (!free || static_cast<double>(*free) >= demand_.bytes_in_flight()) return "";
  return takes() + " is nearly full: " + format_bytes(static_cast<double>(*free)) + " free";
}

std::string TakeDisk::queue_warning(int64_t waiting) {
  queue_is_full_ =
      waiting >= (queue_is_full_ ? demand_.queue_frames / 8 : demand_.queue_frames / 2);
  if (!queue_is_full_) return "";
  return "frames wait to be written: " + takes() +
         " is too slow, or this machine too busy; when more than " +
         std::to_string(demand_.queue_frames) + " of a camera wait, the oldest are lost";
}

std::string TakeDisk::warning(const DiskErrors& errors) const {
  const io::Result<bool> is_gone = this->is_gone();
  if (is_gone.value_or(false)) {
    return "the folder of the take is gone: is the disk of " + takes() + " still mounted?";
  }
  if (errors.failed > 0) {
    return format_count(errors.failed) + " frames not written: " + takes() + " is full or broken";
  }
  if (errors.dropped > 0) {
    return format_count(errors.dropped) + " frames lost: " + takes() +
           " is too slow, or this machine too busy";
  }
  if (!is_gone) return is_gone.error().message;
  const io::Result<uint64_t> free = free_bytes_(take_.folder);
  return free ? shortage_warning(static_cast<double>(*free)) : free.error().message;
}

std::string TakeDisk::shortage_warning(double free_bytes) const {
  const double seconds = free_bytes / std::max(1.0, demand_.bytes_per_pulse * demand_.rate_hz);
  if (seconds > kEnoughSeconds) return "";
  // In steps of 10 s; otherwise the text would change every second.
  return "full in less than " + format_count(10 * (1 + static_cast<int64_t>(seconds) / 10)) +
         " s of recording";
}

}  // namespace v3d::captured
