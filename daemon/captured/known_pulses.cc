#include "daemon/captured/known_pulses.h"

#include <algorithm>

namespace v3d {
namespace {

/// A pulse number from the network is rejected when it is this far ahead of all previous ones.
constexpr int64_t kMaxJump = 15'000;
/// Commanded pulses whose messages have not arrived yet.
constexpr int64_t kMaxInFlight = 2;

}  // namespace

KnownPulses::KnownPulses(std::string take, PulseSet sensed, int64_t commanded)
    : take_(std::move(take)),
      sensed_(std::move(sensed)),
      seen_(std::max(sensed_.last() + 1, commanded - kMaxInFlight)) {}

bool KnownPulses::accepts(const PulseMessage& pulse) const {
  return pulse.take == take_ && pulse.pulse >= seen_ && pulse.pulse - seen_ < kMaxJump;
}

void KnownPulses::add(int64_t pulse) {
  sensed_.insert(pulse);
  seen_ = std::max(seen_, pulse + 1);
}

void KnownPulses::fill_ledger(Ledger& ledger, int64_t commanded) const {
  ledger.sensed = sensed_.size();
  ledger.unsensed = sensed_.missing(commanded);
}

bool sensed_count_is_known(bool has_sense_line, bool senses_here, int64_t sensed,
                           int64_t commanded) {
  return has_sense_line && (senses_here || sensed >= commanded);
}

bool is_empty_take(const Ledger& ledger, bool was_started, bool trigger_is_here) {
  if (was_started && !trigger_is_here) return false;
  const bool no_pulse = ledger.commanded == 0 && ledger.sensed.value_or(0) == 0;
  return no_pulse && std::all_of(ledger.cameras.begin(), ledger.cameras.end(),
                                 [](const CameraLedger& camera) { return camera.written == 0; });
}

}  // namespace v3d
