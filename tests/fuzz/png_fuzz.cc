// Fuzz target: images of a background model (part of every take) and images for a scene. They are
// rejected with an InputError or have the number of samples of their size.
#include "base/core/error.h"
#include "base/image/image_files.h"
#include "fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const v3d::DeepImage image =
        v3d::decode_png({reinterpret_cast<const char*>(data), size}, "cam01.mean.png");
    v3d::test::must(image.samples.size() ==
                    static_cast<size_t>(image.size.pixels()) * static_cast<size_t>(image.channels));
  } catch (const v3d::InputError&) {
  }
  try {
    const v3d::Image image =
        v3d::decode_picture({reinterpret_cast<const char*>(data), size}, "sky.png");
    v3d::test::must(image.bytes.size() == 3 * static_cast<size_t>(image.size.pixels()));
  } catch (const v3d::InputError&) {
  }
  return 0;
}
