// Fuzz target: PLY files. Only InputError may be thrown.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/core/error.h"
#include "common/mesh_formats.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    v3d::parse_ply({reinterpret_cast<const char*>(data), size}, "fuzz.ply");
  } catch (const v3d::InputError&) {
  }
  return 0;
}
