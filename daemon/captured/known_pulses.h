// What a node knows of the pulses of a train, and what its ledger may say of them. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "take/ledger/ledger.h"
#include "take/ledger/pulse_set.h"
#include "wire/messages.h"

namespace v3d {

/// The pulses that a node has sensed, or received word of. One thread.
class KnownPulses {
 public:
  explicit KnownPulses(std::string take) : take_(std::move(take)) {}
  /// A take that this node was in before it restarted. `sensed`: pulses in the log; `commanded`:
  /// pulses of the train until now, or a little fewer.
  KnownPulses(std::string take, PulseSet sensed, int64_t commanded);

  /// False of a pulse from the network that is of another take, older than one received before, or
  /// so far ahead that it is not believed.
  bool accepts(const PulseMessage& pulse) const;
  void add(int64_t pulse);

  /// The highest pulse number, plus one.
  int64_t seen() const { return seen_; }
  /// How many.
  int64_t count() const { return sensed_.size(); }
  /// Of `commanded` pulses: how many were sensed, and which were not.
  void put_into(Ledger& ledger, int64_t commanded) const;

 private:
  std::string take_;
  PulseSet sensed_;
  int64_t seen_ = 0;
};

/// What a ledger may say of the sense line. A node that only listens to the trigger's node, and
/// missed a message, cannot tell. `sensed`: pulses known here.
bool knows_what_was_sensed(bool has_sense_line, bool senses_here, int64_t sensed,
                           int64_t commanded);

/// Whether a take that ends with this account is moved to the quarantine, because nothing happened
/// in it. Frames keep it: a node that heard neither pulses nor the health of the trigger's node
/// knows of no pulse, and has recorded all the same. So does its start, where the trigger is
/// elsewhere: pulses may have run after this node's part ended, and its cameras have to be named as
/// missing them.
bool is_empty_take(const Ledger& ledger, bool was_started, bool trigger_is_here);

}  // namespace v3d
