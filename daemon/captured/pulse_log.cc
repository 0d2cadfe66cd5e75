#include "daemon/captured/pulse_log.h"

#include <spdlog/spdlog.h>

#include "base/io/file.h"

namespace v3d {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(50);
constexpr size_t kQueuePulses = 4096;

}  // namespace

PulseLog::PulseLog(const std::filesystem::path& path, LogOpening opening, Duration sync_period)
    : log_(path, opening, LogHashing::kChecksum, sync_period), queue_(kQueuePulses) {
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
  for (;;) {
    const bool is_last_round = stopping_;
    const auto pulse =
        queue_.pop(is_last_round ? Monotonic::now() : Monotonic::now() + kPollInterval);
    if (pulse) {
      const io::Status written = log_.write(*pulse);
      if (!written && ++failed_ == 1) spdlog::error("{}", written.error().message);
    }
    if (!pulse && is_last_round) return;
  }
}

}  // namespace v3d
