// Fuzz target: exposures.csv. Only InputError may be thrown.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/core/error.h"
#include "sim/cameras/exposure_record.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    v3d::sim::parse_exposures({reinterpret_cast<const char*>(data), size}, "fuzz.csv");
  } catch (const v3d::InputError&) {
  }
  return 0;
}
