#include "codec/colour.h"

namespace v3d {

LumaChroma luma_chroma_of(const VertexColour& colour) {
  const int co = colour[0] - colour[2];
  const int middle = colour[2] + (co >> 1);
  const int cg = colour[1] - middle;
  return {static_cast<int16_t>(middle + (cg >> 1)), static_cast<int16_t>(co),
          static_cast<int16_t>(cg), 0};
}

}  // namespace v3d
