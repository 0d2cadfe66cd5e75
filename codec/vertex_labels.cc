#include "codec/vertex_labels.h"

#include <algorithm>
#include <array>
#include <limits>

#include "codec/check.h"
#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

/// A label is mostly that of the first known vertex. How certain this is, the number of known
/// vertices with this label tells.
class LabelModels {
 public:
  /// The decoder does not use `wanted`. Empty when the decoded number is no label.
  template <class Coder>
  std::optional<uint8_t> code(Coder& coder, KnownVertices::Four known,
                              std::span<const uint8_t> labels, uint8_t wanted) {
    const uint8_t expected = labels[known[0]];
    const auto agree = std::count_if(known.begin(), known.end(),
                                     [&](uint32_t vertex) { return labels[vertex] == expected; });
    if (!coder.bit(differs_[static_cast<size_t>(agree - 1)], wanted != expected)) return expected;
    const uint32_t label = other_.code(coder, wanted);
    if (label > std::numeric_limits<uint8_t>::max()) return std::nullopt;
    return static_cast<uint8_t>(label);
  }

 private:
  std::array<BitModel, KnownVertices::kMaxKnown> differs_;
  NumberModel other_;
};

}  // namespace

std::vector<uint8_t> encode_labels(std::span<const uint8_t> labels, const KnownVertices& known) {
  V3D_CODEC_CHECK(labels.size() == known.vertices());
  RangeEncoder coder;
  LabelModels models;
  std::vector<uint8_t> coded(labels.size());
  for (uint32_t vertex = 0; vertex < coded.size(); ++vertex) {
    models.code(coder, known.of(vertex), coded, labels[vertex]);
    coded[vertex] = labels[vertex];
  }
  return coder.take();
}

std::optional<std::vector<uint8_t>> decode_labels(std::span<const uint8_t> bytes,
                                                  const KnownVertices& known) {
  RangeDecoder coder(bytes);
  LabelModels models;
  std::vector<uint8_t> labels(known.vertices());
  for (uint32_t vertex = 0; vertex < labels.size(); ++vertex) {
    const auto label = models.code(coder, known.of(vertex), labels, 0);
    if (!label || coder.overran()) return std::nullopt;
    labels[vertex] = *label;
  }
  return coder.ended() ? std::optional(std::move(labels)) : std::nullopt;
}

}  // namespace v3d::codec
