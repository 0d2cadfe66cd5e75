// What can go wrong with a camera, on order.
#pragma once

#include <cstdint>
#include <string>

#include "base/time.h"

namespace v3d::sim {

enum class FaultKind : uint8_t {
  kDrop,       ///< exposed and counted, never sent
  kMissed,     ///< the trigger is not seen: neither exposed nor counted
  kDuplicate,  ///< sent twice: the same image and time stamp under the next frame number
  kDelay,      ///< sent late by `time`; the frames behind it wait
  kFreeze,     ///< answers, but neither exposes nor counts for `pulses` pulses
  kUnplug,     ///< gone for `time` from this pulse on; its frame counter begins anew
  kClock,    ///< its clock jumps ahead by `time` (back where negative), and runs `drift_ppm` faster
  kBlack,    ///< the image is black
  kLate,     ///< from this pulse on it shows what was `pulses` pulses before; takes written without
             ///< daemons only
  kSuspect,  ///< the frame counter says another pulse; takes written without daemons only
};

struct Fault {
  std::string camera;
  int64_t pulse = 0;
  FaultKind kind = FaultKind::kDrop;
  int64_t pulses = 1;
  Duration time{};
  double drift_ppm = 0;
  bool new_clock = false;  ///< kUnplug: its clock begins at 0 when it comes back
};

}  // namespace v3d::sim
