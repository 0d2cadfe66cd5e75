// Fuzz target: fault scripts of v3d-sim, for a take and for a studio. Only InputError may be
// thrown, and every fault names an existing camera.
#include <string_view>

#include "base/core/error.h"
#include "fuzz_input.h"
#include "v3d-sim/simulated_take.h"

namespace {

void read(std::string_view text, std::optional<int64_t> take_pulses) {
  v3d::Rig rig(1);
  rig.front().name = "cam01";
  try {
    for (const v3d::sim::Fault& fault :
         v3d::sim::parse_faults(text, "faults.toml", rig, take_pulses)) {
      v3d::test::must(fault.camera == "cam01" && fault.pulse >= 0);
    }
  } catch (const v3d::InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  read(text, 100);
  read(text, std::nullopt);
  return 0;
}
