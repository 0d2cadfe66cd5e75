#include "daemon/captured/pulse_log.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/io/file.h"

namespace v3d::captured {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(50);
constexpr size_t kQueuePulses = 4096;

}  // namespace

PulseLog::PulseLog(const std::filesystem::path& path, take::LogOpening opening,
                   Duration sync_period)
    : log_(path, opening, take::LogHashing::kChecksum, sync_period), queue_(kQueuePulses) {
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

void PulseLog::write(const wire::PulseMessage& pulse, std::optional<RealtimeInstant> edge_here) {
  queue_.push({pulse, edge_here});
}

void PulseLog::run() {
  for (;;) {
    const bool is_last_iteration = stopping_;
    const auto next =
        queue_.pop(is_last_iteration ? Monotonic::now() : Monotonic::now() + kPollInterval);
    if (next) {
      const io::Status written = log_.write(next->pulse, next->edge_here);
      if (!written && ++failed_ == 1) spdlog::error("{}", written.error().message);
    }
    if (!next && is_last_iteration) return;
  }
}

namespace {

/// Commanded pulses whose messages have not arrived yet.
constexpr int64_t kMaxInFlight = 2;

}  // namespace

KnownPulses::KnownPulses(std::string take, MonotonicInstant now)
    : KnownPulses(std::move(take), {}, 0, now) {}

KnownPulses::KnownPulses(std::string take, take::PulseSet sensed, int64_t commanded,
                         MonotonicInstant now)
    : take_(std::move(take)),
      sensed_(std::move(sensed)),
      seen_(std::max(sensed_.last() + 1, commanded - kMaxInFlight)) {
  plausible_.add(seen_, now);
}

bool KnownPulses::accepts(const wire::PulseMessage& pulse, MonotonicInstant now) const {
  return pulse.take == take_ && pulse.pulse >= seen_ && plausible_.contains(pulse.pulse, now);
}

void KnownPulses::add(int64_t pulse, MonotonicInstant now) {
  sensed_.insert(pulse);
  plausible_.add(pulse, now);
  seen_ = std::max(seen_, pulse + 1);
}

void KnownPulses::fill_ledger(take::Ledger& ledger, int64_t commanded) const {
  ledger.sensed = sensed_.size();
  ledger.unsensed = sensed_.missing(commanded);
}

bool sensed_count_is_known(bool has_sense_line, bool senses_here, int64_t sensed,
                           int64_t commanded) {
  return has_sense_line && (senses_here || sensed >= commanded);
}

bool is_empty_take(const take::Ledger& ledger, bool was_started, bool trigger_is_here) {
  if (was_started && !trigger_is_here) return false;
  const bool no_pulse = ledger.commanded == 0 && ledger.sensed.value_or(0) == 0;
  return no_pulse &&
         std::all_of(ledger.cameras.begin(), ledger.cameras.end(),
                     [](const take::CameraLedger& camera) { return camera.written == 0; });
}

}  // namespace v3d::captured
