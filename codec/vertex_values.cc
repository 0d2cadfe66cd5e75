#include "codec/vertex_values.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <utility>

#include "codec/range_coder.h"

namespace v3d {
namespace {

constexpr uint32_t kGroup = 64;  // vertices that are predicted alike
constexpr uint32_t kSample = 4;  // of these the encoder looks at one in so many to decide

/// sum / count, rounded; count 1 to 4. Normative: a decoder computes exactly this.
int rounded_mean(int64_t sum, size_t count) {
  constexpr std::array<int64_t, 5> kInverse{0, 65536, 32768, 21845, 16384};
  return static_cast<int>((sum * kInverse[count] + 32768) >> 16);
}

/// Prediction of one vertex, and how much that differs what it comes from.
struct Guess {
  VertexValues mean;
  VertexValues spread{};
};

inline Guess guess_from(std::span<const uint32_t> known, std::span<const VertexValues> values) {
  // Loops over four, each for itself: the compiler makes vectors of them.
  constexpr int kLanes = 4;
  VertexValues sum = values[known[0]];
  VertexValues least = sum, most = sum;
  for (size_t k = 1; k < known.size(); ++k) {
    const VertexValues value = values[known[k]];
    for (int n = 0; n < kLanes; ++n) sum[n] += value[n];
    for (int n = 0; n < kLanes; ++n) least[n] = std::min(value[n], least[n]);
    for (int n = 0; n < kLanes; ++n) most[n] = std::max(value[n], most[n]);
  }
  Guess guess;
  for (int n = 0; n < 3; ++n) {
    guess.mean[n] = rounded_mean(sum[n], known.size());
    guess.spread[n] = most[n] - least[n];
  }
  return guess;
}

/// To the nearest whole number of steps, halves towards 0: what has not changed since the frame
/// before is not touched again.
int steps_in(int difference, int step) {
  const int half = (step - 1) / 2;
  return difference < 0 ? -((half - difference) / step) : (difference + half) / step;
}

/// What the spread of the known values tells of the residual.
class SpreadClasses {
 public:
  static constexpr int kCount = 6;
  explicit SpreadClasses(int step) {
    constexpr std::array<int, kCount - 1> kBounds{1, 3, 6, 10, 16};  // half steps
    for (size_t spread = 0; spread < classes_.size(); ++spread) {
      const int halves = 2 * static_cast<int>(spread) / step;
      classes_[spread] = static_cast<uint8_t>(
          std::count_if(kBounds.begin(), kBounds.end(), [&](int b) { return halves >= b; }));
    }
  }
  int operator[](int spread) const {
    return classes_[std::min(static_cast<size_t>(spread), classes_.size() - 1)];
  }

 private:
  std::array<uint8_t, 512> classes_{};
};

/// For each way to predict: learns how far values are from there.
class Models {
 public:
  /// `before`: residuals of the same vertex that are coded already.
  ResidualModel& at(int n, int spread_class, size_t known, const VertexValues& before) {
    if (n == 0) return first_[spread_class][known > 1 ? 1 : 0];
    const int first = std::min(std::abs(before[0]), 2);
    const int second = n == 1 ? 0 : std::min(std::abs(before[1]), 1);
    return others_[n - 1][spread_class][first][second];
  }

 private:
  using Others = std::array<std::array<ResidualModel, 2>, 3>;
  std::array<std::array<ResidualModel, 2>, SpreadClasses::kCount> first_;
  std::array<std::array<Others, SpreadClasses::kCount>, 2> others_;
};

/// `Coder` is RangeEncoder or RangeDecoder; the decoder has no `wanted` values.
template <class Coder>
class ValueCode {
 public:
  ValueCode(Coder& coder, const KnownVertices& known, const ValueRange& range,
            const FormerValues* former)
      : coder_(coder), known_(known), range_(range), former_(former) {}

  /// False: beyond the end of the bytes.
  bool run(std::span<const VertexValues> wanted) {
    decoded_.resize(known_.vertices());
    BitModel model;
    bool from_former = false;
    for (uint32_t vertex = 0; vertex < decoded_.size(); ++vertex) {
      if (vertex % kGroup == 0) {
        if (overran()) return false;
        from_former =
            former_ != nullptr && coder_.bit(model, !kDecodes && former_is_nearer(vertex, wanted));
      }
      const VertexValues* former = from_former ? former_->at(vertex) : nullptr;
      if constexpr (kDecodes) {
        RangeDecoder in_registers = coder_;
        code(in_registers, vertex, former, wanted);
        coder_ = in_registers;
      } else {
        code(coder_, vertex, former, wanted);
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

  Guess guess(uint32_t vertex, std::span<const VertexValues> values) const {
    const std::span<const uint32_t> known = known_.of(vertex);
    return known.empty() ? Guess{range_.first} : guess_from(known, values);
  }

  bool former_is_nearer(uint32_t vertex, std::span<const VertexValues> wanted) const;
  void code(Coder& coder, uint32_t vertex, const VertexValues* former,
            std::span<const VertexValues> wanted);

  Coder& coder_;
  const KnownVertices& known_;
  const ValueRange& range_;
  const FormerValues* const former_;
  std::vector<VertexValues> decoded_;
  std::array<Models, 2> models_;  ///< from the surface, from the frame before
  std::array<SpreadClasses, 3> classes_{
      SpreadClasses(range_.step[0]), SpreadClasses(range_.step[1]), SpreadClasses(range_.step[2])};
};

template <class Coder>
void ValueCode<Coder>::code(Coder& coder, uint32_t vertex, const VertexValues* former,
                            std::span<const VertexValues> wanted) {
  Guess from = guess(vertex, decoded_);
  if (former != nullptr) from.mean = *former;
  Models& models = models_[former != nullptr ? 1 : 0];
  const size_t known = known_.of(vertex).size();
  VertexValues residual{};
  VertexValues& decoded = decoded_[vertex];
  for (int n = 0; n < 3; ++n) {
    const int step = range_.step[n];
    if (!kDecodes) residual[n] = steps_in(wanted[vertex][n] - from.mean[n], step);
    ResidualModel& model = models.at(n, classes_[n][from.spread[n]], known, residual);
    residual[n] = model.code(coder, residual[n]);
    decoded[n] = std::clamp(from.mean[n] + residual[n] * step, range_.least[n], range_.most[n]);
  }
}

/// By the first value of some of the group that begins at `vertex`, as if nothing were quantised.
template <class Coder>
bool ValueCode<Coder>::former_is_nearer(uint32_t vertex,
                                        std::span<const VertexValues> wanted) const {
  int64_t from_surface = 0, from_former = 0;
  const auto end = static_cast<uint32_t>(std::min<size_t>(vertex + kGroup, wanted.size()));
  for (; vertex < end; vertex += kSample) {
    const VertexValues* former = former_->at(vertex);
    if (former == nullptr) continue;
    from_surface += std::abs(wanted[vertex][0] - guess(vertex, wanted).mean[0]);
    from_former += std::abs(wanted[vertex][0] - (*former)[0]);
  }
  return 4 * from_former < 3 * from_surface;  // looking there costs the decoder time
}

}  // namespace

CodedValues encode_values(std::span<const VertexValues> values, const KnownVertices& known,
                          const ValueRange& range, const FormerValues* former) {
  assert(values.size() == known.vertices());
  RangeEncoder coder;
  ValueCode code(coder, known, range, former);
  code.run(values);
  return {coder.take(), std::move(code.decoded())};
}

std::optional<std::vector<VertexValues>> decode_values(std::span<const uint8_t> bytes,
                                                       const KnownVertices& known,
                                                       const ValueRange& range,
                                                       const FormerValues* former) {
  RangeDecoder coder(bytes);
  ValueCode code(coder, known, range, former);
  if (!code.run({}) || !coder.ended()) return std::nullopt;
  return std::move(code.decoded());
}

}  // namespace v3d
