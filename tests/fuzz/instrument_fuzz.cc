// Fuzz target: data from a signal generator: USBTMC transfers, and replies in every dialect.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "trigger/scpi/scpi_dialect.h"
#include "trigger/scpi/usbtmc.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (size > 1) v3d::trigger::parse_usbtmc_in({data, size}, data[1]);
  for (const std::string_view expected : {"25", "INF", "ON", "OFF", "PULS", "0.001"}) {
    for (const std::string_view field : {"", "*", "FRQ"}) {
      v3d::trigger::answer_matches(text, field, expected);
    }
  }
  return 0;
}
