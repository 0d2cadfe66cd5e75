// The pulse numbers that a node has sensed or received, and rules for the ledger that depend on
// them. No input or output.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "take/ledger/ledger.h"
#include "take/ledger/pulse_set.h"
#include "wire/messages.h"

namespace v3d {

/// The pulses of one take that this node has sensed or received. One thread.
class KnownPulses {
 public:
  explicit KnownPulses(std::string take) : take_(std::move(take)) {}
  /// Resumes a take after a restart. `sensed`: pulses in the log. `commanded`: pulses of the train
  /// until now, or up to two fewer.
  KnownPulses(std::string take, PulseSet sensed, int64_t commanded);

  /// False for a pulse message of another take, for a number below seen(), and for a number 15,000
  /// or more above it, which is implausible.
  bool accepts(const PulseMessage& pulse) const;
  void add(int64_t pulse);

  /// The highest pulse number plus one.
  int64_t seen() const { return seen_; }
  /// The number of pulses sensed or received.
  int64_t count() const { return sensed_.size(); }
  /// Sets the number of sensed pulses and the list of those not sensed, out of `commanded`.
  void fill_ledger(Ledger& ledger, int64_t commanded) const;

 private:
  std::string take_;
  PulseSet sensed_;
  int64_t seen_ = 0;
};

/// Whether the ledger may state how many pulses were sensed. It may not without a sense line, nor
/// on a node that receives pulse messages from the trigger's node and has lost some. `sensed`:
/// pulses sensed or received here.
bool sensed_count_is_known(bool has_sense_line, bool senses_here, int64_t sensed,
                           int64_t commanded);

/// Whether a take with this ledger is empty and belongs into the quarantine.
///
/// A take with frames is not empty, even without pulses: the messages of the trigger's node may
/// have been lost. Neither is a take that was started with the trigger on another node: pulses may
/// have run after this node's part ended, and the ledger must list its cameras as missing them.
bool is_empty_take(const Ledger& ledger, bool was_started, bool trigger_is_here);

}  // namespace v3d
