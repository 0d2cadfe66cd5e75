// Fuzz target: images of previews. A decoded image has the requested size.
#include <cstdlib>

#include "base/image/image_files.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const v3d::ImageSize wanted{data[0] % 64 + 1, data[1] % 64 + 1};
  const auto image = v3d::decode_jpeg({data + 2, size - 2}, wanted);
  if (image && image->bytes.size() != 3 * static_cast<size_t>(wanted.pixels())) std::abort();
  return 0;
}
