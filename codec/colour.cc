#include "codec/colour.h"

namespace v3d {

VertexValues luma_chroma_of(const VertexColour& colour) {
  const int co = colour[0] - colour[2];
  const int middle = colour[2] + (co >> 1);
  const int cg = colour[1] - middle;
  return {middle + (cg >> 1), co, cg};
}

ValueRange colour_range(const std::array<uint8_t, 3>& steps) {
  ValueRange range;
  for (int n = 0; n < 3; ++n) range.step[n] = steps[n];
  range.least = {0, -255, -255};
  range.most = {255, 255, 255};
  range.first = {128, 0, 0};
  return range;
}

}  // namespace v3d
