// Compact frames from the wire or a file: nothing, or a sound mesh that is encoded as itself again.
#include <cstdlib>

#include "base/error.h"
#include "recon/compact_frame.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto frame = v3d::decode_compact({data, size});
  if (!frame) {
    return 0;
  }
  for (const auto& triangle : frame->mesh.triangles) {
    for (const uint32_t v : triangle) {
      if (v >= frame->mesh.vertices.size()) {
        std::abort();
      }
    }
  }
  try {
    // The step may be so small beside the origin that lattice points fall together: then positions
    // need not lead back to the same points, but the frame is coded or refused, never misread.
    const auto again = v3d::decode_compact(v3d::encode_compact(*frame));
    if (!again || again->mesh.triangles != frame->mesh.triangles ||
        again->mesh.colours != frame->mesh.colours) {
      std::abort();
    }
  } catch (const v3d::InputError&) {
  }
  return 0;
}
