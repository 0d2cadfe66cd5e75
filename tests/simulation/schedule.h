// One schedule: a studio, its operators and what goes wrong, all drawn from a seed, played in
// virtual time and judged.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "simulation/protocol_events.h"

namespace v3d::simulation {

struct Outcome {
  std::string violation;  ///< empty: every invariant held
  std::vector<std::string> trace;
  ProtocolTrace events;
  int pulses = 0;
  int takes = 0;
  int complete = 0;      ///< takes whose joined ledger is complete
  int faults = 0;        ///< crashes, partitions, full disks ...
  double settled_s = 0;  ///< after the faults ended, until nothing went on unattended
  double idle_s = 0;     ///< and from the operator's stop until every node was idle
};

/// The same seed gives the same outcome.
Outcome play_schedule(uint64_t seed, bool with_trace);

}  // namespace v3d::simulation
