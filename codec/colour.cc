#include "codec/colour.h"

#include <algorithm>

namespace v3d {

VertexValues luma_chroma_of(const VertexColour& colour) {
  const int co = colour[0] - colour[2];
  const int middle = colour[2] + (co >> 1);
  const int cg = colour[1] - middle;
  return {middle + (cg >> 1), co, cg};
}

VertexColour colour_of(const VertexValues& luma_chroma) {
  const auto [luma, co, cg, unused] = luma_chroma;
  const int middle = luma - (cg >> 1);
  const int blue = middle - (co >> 1);
  const auto byte = [](int value) { return static_cast<uint8_t>(std::clamp(value, 0, 255)); };
  return {byte(blue + co), byte(cg + middle), byte(blue)};
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
