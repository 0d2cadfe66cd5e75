#include "daemon/captured/pulse_log.h"

#include <spdlog/spdlog.h>

#include "base/io/file.h"

namespace v3d {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(50);
constexpr size_t kQueuePulses = 4096;
/// Time between flushes; a power cut loses the pulses of at most this time.
constexpr Duration kSyncEvery = std::chrono::seconds(1);

}  // namespace

PulseLog::PulseLog(const std::filesystem::path& path, LogOpening opening)
    : log_(path, opening), queue_(kQueuePulses) {
  if (auto synced = io::sync_folder(path.parent_path()); !synced) {
    io::throw_input_error(synced.error());
  }
  thread_ = std::thread([this] { run(); });
}

PulseLog::~PulseLog() { close(); }

void PulseLog::close() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  thread_.join();
  synced_ = log_.sync();
  if (!synced_) spdlog::error("{}", synced_.error().message);
}

void PulseLog::write(const PulseMessage& pulse) { queue_.push(pulse); }

void PulseLog::run() {
  MonotonicInstant next_sync = Monotonic::now() + kSyncEvery;
  for (;;) {
    const bool is_last_round = stopping_;
    const auto pulse =
        queue_.pop(is_last_round ? Monotonic::now() : Monotonic::now() + kPollInterval);
    if (pulse) {
      const io::Status written = log_.write(*pulse);
      if (!written && ++failed_ == 1) spdlog::error("{}", written.error().message);
    }
    if (pulse && Monotonic::now() >= next_sync) {
      // An error is reported by the next write, which then fails, too.
      static_cast<void>(log_.sync());
      next_sync = Monotonic::now() + kSyncEvery;
    }
    if (!pulse && is_last_round) return;
  }
}

}  // namespace v3d
