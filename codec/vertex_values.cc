#include "codec/vertex_values.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <utility>

#include "codec/check.h"
#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

constexpr uint32_t kGroup = 64;  // vertices between two checks for the end of the bytes

/// Prediction of one vertex, and the spread of the values that it is computed from.
struct Prediction {
  VertexValues mean;
  VertexValues spread{};
};

inline Prediction predict_values(KnownVertices::Four known, std::span<const VertexValues> values) {
  constexpr int kLanes = 4;  // separate loops, which the compiler vectorises
  const VertexValues a = values[known[0]], b = values[known[1]];
  const VertexValues c = values[known[2]], d = values[known[3]];
  Prediction prediction;
  for (int n = 0; n < kLanes; ++n) prediction.mean[n] = (a[n] + b[n] + c[n] + d[n] + 2) >> 2;
  for (int n = 0; n < kLanes; ++n) {
    const int low = std::min(std::min(a[n], b[n]), std::min(c[n], d[n]));
    const int high = std::max(std::max(a[n], b[n]), std::max(c[n], d[n]));
    prediction.spread[n] = high - low;
  }
  return prediction;
}

/// Table of spread_class() for a step of 1.
class SpreadClasses {
 public:
  SpreadClasses() {
    for (size_t spread = 0; spread < classes_.size(); ++spread) {
      classes_[spread] = static_cast<uint8_t>(spread_class(static_cast<int>(spread), 1));
    }
  }
  int operator[](int spread) const {
    return classes_[std::min(static_cast<size_t>(spread), classes_.size() - 1)];
  }

 private:
  std::array<uint8_t, 9> classes_{};  ///< larger spreads have the last class
};

/// Adaptive models of the residuals.
class Models {
 public:
  /// `before`: residuals of the same vertex that are already coded.
  ResidualModel& at(int n, int class_index, const VertexValues& before) {
    if (n == 0) return first_[class_index];
    const int first = std::min(std::abs(before[0]), 2);
    const int second = n == 1 ? 0 : std::min(std::abs(before[1]), 1);
    return others_[n - 1][class_index][first][second];
  }

 private:
  using Others = std::array<std::array<ResidualModel, 2>, 3>;
  std::array<ResidualModel, kSpreadClasses> first_;
  std::array<std::array<Others, kSpreadClasses>, 2> others_;
};

/// `Coder` is RangeEncoder or RangeDecoder. The decoder does not use the `wanted` values.
template <class Coder>
class ValueCode {
 public:
  ValueCode(Coder& coder, const KnownVertices& known, const ValueRange& range)
      : coder_(coder), known_(known), range_(range) {}

  /// False when the end of the bytes was exceeded.
  bool run(std::span<const VertexValues> wanted) {
    decoded_.assign(known_.vertices(), {});
    for (uint32_t vertex = 0; vertex < decoded_.size(); ++vertex) {
      if (vertex % kGroup == 0 && overran()) return false;
      if constexpr (kDecodes) {
        RangeDecoder in_registers = coder_;
        code(in_registers, vertex, wanted);
        coder_ = in_registers;
      } else {
        code(coder_, vertex, wanted);
      }
    }
    return true;
  }
  std::vector<VertexValues>& decoded() { return decoded_; }

 private:
  static constexpr bool kDecodes = std::is_same_v<Coder, RangeDecoder>;

  bool overran() const {
    if constexpr (kDecodes) return coder_.overran();
    return false;
  }
  void code(Coder& coder, uint32_t vertex, std::span<const VertexValues> wanted);

  Coder& coder_;
  const KnownVertices& known_;
  const ValueRange& range_;
  std::vector<VertexValues> decoded_;
  Models models_;
  SpreadClasses classes_;
};

template <class Coder>
void ValueCode<Coder>::code(Coder& coder, uint32_t vertex, std::span<const VertexValues> wanted) {
  const Prediction from = predict_values(known_.of(vertex), decoded_);
  VertexValues residual{};
  VertexValues& decoded = decoded_[vertex];
  for (int n = 0; n < 3; ++n) {
    if (!kDecodes) residual[n] = wanted[vertex][n] - from.mean[n];
    ResidualModel& model = models_.at(n, classes_[from.spread[n]], residual);
    residual[n] = model.code(coder, residual[n]);
    decoded[n] = std::clamp(from.mean[n] + residual[n], range_.min, range_.max);
  }
}

}  // namespace

std::vector<uint8_t> encode_values(std::span<const VertexValues> values, const KnownVertices& known,
                                   const ValueRange& range) {
  V3D_CODEC_CHECK(values.size() == known.vertices());
  RangeEncoder coder;
  ValueCode(coder, known, range).run(values);
  return coder.take();
}

std::optional<std::vector<VertexValues>> decode_values(std::span<const uint8_t> bytes,
                                                       const KnownVertices& known,
                                                       const ValueRange& range) {
  RangeDecoder coder(bytes);
  ValueCode code(coder, known, range);
  if (!code.run({}) || !coder.ended()) return std::nullopt;
  return std::move(code.decoded());
}

void KnownVertices::make(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices) {
  known_.assign(vertices, {});
  for (const auto& [a, b, c] : triangles) {
    add(a, b);
    add(b, c);
    add(c, a);
  }
  for (uint32_t vertex = 0; vertex < vertices; ++vertex) {
    known_[vertex].repeat(vertex - uint32_t{vertex > 0});
  }
}

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
