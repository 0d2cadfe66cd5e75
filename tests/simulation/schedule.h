// One random schedule: a studio, its operators and its faults, drawn from a seed. It runs in
// virtual time, and all invariants are checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "simulation/protocol_events.h"

namespace v3d::simulation {

/// Result of a schedule.
struct Outcome {
  std::string violation;  ///< the first violation; empty: none
  std::vector<std::string> trace;
  ProtocolTrace events;
  int pulses = 0;
  int takes = 0;
  int complete = 0;            ///< takes whose joined ledger is complete
  bool loses_ledgers = false;  ///< a disk takes no ledger at some time
  int faults = 0;              ///< injected faults: crashes, partitions, full disks ...
  double settled_s = 0;        ///< seconds from the end of the faults until the studio was settled
  double idle_s = 0;           ///< seconds from the operator's stop until every node was idle
};

/// Runs the schedule of `seed`; the same seed gives the same outcome. `with_trace` fills
/// Outcome::trace.
Outcome play_schedule(uint64_t seed, bool with_trace);

}  // namespace v3d::simulation
