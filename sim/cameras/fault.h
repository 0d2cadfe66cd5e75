// Camera faults that the simulation can inject.
#pragma once

#include <cstdint>
#include <string>

#include "base/core/time.h"

namespace v3d::sim {

enum class FaultKind : uint8_t {
  kDrop,       ///< the frame is exposed and counted, but not sent
  kMissed,     ///< the trigger is ignored: no exposure, no count
  kDuplicate,  ///< sent twice, with equal time stamps and consecutive frame numbers
  kDelay,      ///< sent late by `time`, like all frames queued after it
  kFreeze,     ///< no exposures and no counts for `pulses` pulses; control works
  kUnplug,     ///< disconnected for `time` from this pulse; the frame counter restarts
  kClock,      ///< the clock jumps by `time` (may be negative) and runs `drift_ppm` faster
  kBlack,      ///< the image is black
  kLate,       ///< from this pulse, images lag by `pulses` pulses; only in takes written without
               ///< daemons
  kSuspect,    ///< the frame counter is wrong; only in takes written without daemons
};

struct Fault {
  std::string camera;
  int64_t pulse = 0;
  FaultKind kind = FaultKind::kDrop;
  int64_t pulses = 1;
  Duration time{};
  double drift_ppm = 0;
  bool new_clock = false;  ///< kUnplug: the clock restarts at 0
};

}  // namespace v3d::sim
