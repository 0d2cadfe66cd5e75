// Fuzz target: replies of chronyd. They are rejected or give finite numbers.
#include <cmath>

#include "daemon/control/clock_monitor.h"
#include "fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(data, size);
  const uint32_t sequence = size >= 20 ? uint32_t{data[19]} : 0;
  if (const auto tracking = v3d::control::parse_tracking(bytes, sequence)) {
    v3d::test::must(std::isfinite(tracking->offset_s) && std::isfinite(tracking->rms_offset_s) &&
                    std::isfinite(tracking->error_bound_s));
  }
  return 0;
}
