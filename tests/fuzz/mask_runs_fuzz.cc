// Fuzz target: run-length codes of masks. They are rejected or give a mask that encodes to the same
// bytes.
#include <cstdlib>

#include "base/image/mask.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) {
    return 0;
  }
  const v3d::ImageSize image{data[0] + 1, data[1] + 1};
  const std::span<const uint8_t> runs(data + 2, size - 2);
  const auto mask = v3d::decode_runs(runs, image);
  if (mask && v3d::encode_runs(*mask) != std::vector<uint8_t>(runs.begin(), runs.end())) {
    std::abort();
  }
  return 0;
}
