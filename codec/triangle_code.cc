#include "codec/triangle_code.h"

#include <algorithm>

#include "codec/range_coder.h"

namespace v3d {
namespace {

/// Models of indices, which are counted back from the next unused number. The model is selected by
/// the position in the triangle and by whether the previous index was new.
class IndexModels {
 public:
  template <class Coder>
  uint32_t code(Coder& coder, int tip, uint32_t back) {
    back = models_[tip][new_before_ ? 1 : 0].code(coder, back);
    new_before_ = back == 0;
    return back;
  }

 private:
  std::array<std::array<NumberModel, 2>, 3> models_;
  bool new_before_ = false;
};

}  // namespace

std::optional<std::vector<uint8_t>> encode_triangles(
    std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices) {
  RangeEncoder coder;
  IndexModels models;
  uint32_t next = 0;
  for (const auto& triangle : triangles) {
    for (int tip = 0; tip < 3; ++tip) {
      const uint32_t index = triangle[tip];
      if (index > next || index >= vertices) return std::nullopt;
      models.code(coder, tip, next - index);
      next += index == next;
    }
  }
  return coder.take();
}

std::optional<std::vector<std::array<uint32_t, 3>>> decode_triangles(std::span<const uint8_t> bytes,
                                                                     uint32_t triangles,
                                                                     uint32_t vertices) {
  RangeDecoder coder(bytes);
  IndexModels models;
  std::vector<std::array<uint32_t, 3>> decoded;
  uint32_t next = 0;
  for (uint32_t t = 0; t < triangles; ++t) {
    std::array<uint32_t, 3>& triangle = decoded.emplace_back();
    for (int tip = 0; tip < 3; ++tip) {
      const uint32_t back = models.code(coder, tip, 0);
      if (back > next || (back == 0 && next == vertices) || coder.overran()) return std::nullopt;
      triangle[tip] = next - back;
      next += back == 0;
    }
  }
  return coder.ended() ? std::optional(std::move(decoded)) : std::nullopt;
}

}  // namespace v3d
