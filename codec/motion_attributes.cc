// Coders of the colours and of the confidences of a tracked surface.
#include <algorithm>
#include <bit>
#include <cstdlib>

#include "codec/check.h"
#include "codec/motion_pulse.h"

namespace v3d::codec {
namespace {

constexpr size_t kChannels = 3;
/// The weight of the change of the neighbours is in units of 1/4096, the change in 1/16.
constexpr int kWeightBits = 12, kChangeBits = 4;
using ChangeWeights = std::array<int16_t, kChannels>;

int floor_divide(int number, int by) { return (number - (((number % by) + by) % by)) / by; }

int clamp_channel(int value, size_t channel) {
  return std::clamp(value, channel == 0 ? 0 : -255, 255);
}

/// What predicts the colours of a pulse.
class ColourPredictor {
 public:
  ColourPredictor(const VertexHierarchy& hierarchy, References references)
      : hierarchy_(hierarchy), references_(references) {}

  /// With references: the colour there, changed as the coarse neighbours have changed since.
  /// Without: the mean of the coarse neighbours.
  int predict(uint32_t vertex, size_t channel, std::span<const LumaChroma> colours,
              int16_t weight) const {
    const auto neighbours = hierarchy_.neighbours(vertex);
    const auto count = static_cast<int>(neighbours.size());
    if (references_.empty()) {
      if (count == 0) return channel == 0 ? 128 : 0;
      int sum = 0;
      for (const uint32_t other : neighbours) sum += colours[other][channel];
      return floor_divide(2 * sum + count, 2 * count);
    }
    const int change = weight * change_around(vertex, channel, colours);
    const int rounding = 1 << (kWeightBits + kChangeBits - 1);
    return clamp_channel(
        before(vertex, channel) + ((change + rounding) >> (kWeightBits + kChangeBits)), channel);
  }

  /// Change of the coarse neighbours since the references, 1/16.
  int change_around(uint32_t vertex, size_t channel, std::span<const LumaChroma> colours) const {
    const auto neighbours = hierarchy_.neighbours(vertex);
    if (neighbours.empty()) return 0;
    int sum = 0;
    for (const uint32_t other : neighbours) sum += colours[other][channel] - before(other, channel);
    return sum * (1 << kChangeBits) / static_cast<int>(neighbours.size());
  }
  /// The colour in the references: one, or the mean of the first two.
  int before(uint32_t vertex, size_t channel) const {
    const int first = references_[0]->colours[vertex][channel];
    return references_.size() == 1 ? first
                                   : (first + references_[1]->colours[vertex][channel] + 1) >> 1;
  }

  /// Eight times the expected magnitude of the residual.
  uint32_t expected(uint32_t vertex, size_t channel,
                    std::span<const std::array<uint8_t, kChannels>> residuals) const {
    const auto neighbours = hierarchy_.neighbours(vertex);
    uint32_t sum = 0;
    for (const uint32_t other : neighbours) sum += residuals[other][channel];
    const uint32_t around = 8 * sum / std::max(static_cast<uint32_t>(neighbours.size()), 1U);
    if (references_.empty()) return around;
    return (2 * around + 8U * references_[0]->colour_residuals[vertex][channel]) / 3;
  }

 private:
  const VertexHierarchy& hierarchy_;
  References references_;
};

/// Residual of `error` in steps. After a reference it is 0 for an error below a step, so that noise
/// causes few updates and no flicker.
int quantised(int error, int step, bool has_reference) {
  const int magnitude = std::abs(error);
  if (has_reference && magnitude < step) return 0;
  const int residual = (2 * magnitude + step) / (2 * step);
  return error < 0 ? -residual : residual;
}

/// Codes the colours of a pulse into state.colours. `wanted`: empty for the decoder.
template <class Coder>
bool code_colours(Coder& coder, std::span<const LumaChroma> wanted,
                  const VertexHierarchy& hierarchy, const ColourSteps& steps, References references,
                  ChangeWeights weights, PulseState& state) {
  for (size_t channel = 0; !references.empty() && channel < kChannels; ++channel) {
    uint32_t bits = 0;
    for (int digit = 15; digit >= 0; --digit) {
      bits = bits << 1 | uint32_t{coder.even_bit((weights[channel] >> digit & 1) != 0)};
    }
    weights[channel] = static_cast<int16_t>(bits);
  }
  if (!references.empty()) state.colour_models = references[0]->colour_models;
  state.colours.assign(hierarchy.order().size(), {});
  state.colour_residuals.assign(state.colours.size(), {});
  const ColourPredictor predictor(hierarchy, references);
  for (const uint32_t v : hierarchy.order()) {
    int luma = 0;
    for (size_t channel = 0; channel < kChannels; ++channel) {
      const int predicted = predictor.predict(v, channel, state.colours, weights[channel]);
      const int step = steps[channel];
      const int residual =
          wanted.empty() ? 0 : quantised(wanted[v][channel] - predicted, step, !references.empty());
      const uint32_t expected = predictor.expected(v, channel, state.colour_residuals);
      const int coded = state.colour_models.of(channel, expected, luma).code(coder, residual);
      state.colours[v][channel] =
          static_cast<int16_t>(clamp_channel(predicted + coded * step, channel));
      state.colour_residuals[v][channel] = static_cast<uint8_t>(std::min(std::abs(coded), 255));
      if (channel == 0) luma = coded;
    }
    if constexpr (requires { coder.overran(); }) {
      if (coder.overran()) return false;
    }
  }
  return true;
}

/// Weights of least squared error, by the original colours.
ChangeWeights fit_weights(std::span<const LumaChroma> colours, const VertexHierarchy& hierarchy,
                          References references) {
  ChangeWeights weights{};
  if (references.empty()) return weights;
  const ColourPredictor predictor(hierarchy, references);
  for (size_t channel = 0; channel < kChannels; ++channel) {
    double product = 0, square = 1;
    for (const uint32_t v : hierarchy.order()) {
      const double change = predictor.change_around(v, channel, colours) / 16.0;
      product += change * (colours[v][channel] - predictor.before(v, channel));
      square += change * change;
    }
    weights[channel] = static_cast<int16_t>(4096 * std::clamp(product / square, 0.0, 1.0));
  }
  return weights;
}

/// The level of a vertex as the references and its coarse neighbours suggest it.
struct ExpectedLevels {
  size_t in_time = 0, in_space = 0;
};

ExpectedLevels expected_levels(uint32_t vertex, const VertexHierarchy& hierarchy,
                               References references, std::span<const uint8_t> levels) {
  ExpectedLevels expected;
  const auto neighbours = hierarchy.neighbours(vertex);
  size_t sum = neighbours.size() / 2;
  for (const uint32_t other : neighbours) sum += levels[other];
  if (!neighbours.empty()) expected.in_space = sum / neighbours.size();
  if (references.empty()) return expected;
  expected.in_time = references[0]->confidences[vertex];
  if (references.size() > 1) {
    expected.in_time = (expected.in_time + references[1]->confidences[vertex] + 1U) / 2;
  }
  return expected;
}

template <class Coder>
bool code_confidences(Coder& coder, const VertexHierarchy& hierarchy, size_t levels,
                      References references, PulseState& state) {
  if (!references.empty()) state.confidence_models = references[0]->confidence_models;
  for (const uint32_t v : hierarchy.order()) {
    const auto [in_time, in_space] = expected_levels(v, hierarchy, references, state.confidences);
    ConfidenceModels::Tree& tree = state.confidence_models.of(in_time, in_space);
    uint8_t& level = state.confidences[v];
    size_t node = 1;
    for (int digit = std::bit_width(levels - 1) - 1; digit >= 0; --digit) {
      node = 2 * node + size_t{coder.bit(tree[node], (level >> digit & 1) != 0)};
    }
    node -= std::bit_floor(node);
    if (node >= levels) return false;
    level = static_cast<uint8_t>(node);
    if constexpr (requires { coder.overran(); }) {
      if (coder.overran()) return false;
    }
  }
  return true;
}

}  // namespace

IntegerModel& ColourModels::of(size_t channel, uint32_t around, int luma) {
  const auto index = static_cast<size_t>(std::bit_width(around));
  const auto luma_index = static_cast<size_t>(std::abs(luma));
  return models_[channel][std::min(index, kClasses - 1)][std::min(luma_index, kLumaClasses - 1)];
}

std::vector<uint8_t> encode_motion_colours(std::span<const LumaChroma> colours,
                                           const VertexHierarchy& hierarchy,
                                           const ColourSteps& steps, References references,
                                           PulseState& state) {
  V3D_CODEC_CHECK(colours.size() == hierarchy.order().size());
  RangeEncoder coder;
  const ChangeWeights weights = fit_weights(colours, hierarchy, references);
  V3D_CODEC_CHECK(code_colours(coder, colours, hierarchy, steps, references, weights, state));
  return coder.take();
}

bool decode_motion_colours(std::span<const uint8_t> bytes, const VertexHierarchy& hierarchy,
                           const ColourSteps& steps, References references, PulseState& state) {
  RangeDecoder coder(bytes);
  return code_colours(coder, {}, hierarchy, steps, references, {}, state) && coder.ended();
}

std::vector<uint8_t> encode_confidences(const VertexHierarchy& hierarchy, size_t levels,
                                        References references, PulseState& state) {
  V3D_CODEC_CHECK(state.confidences.size() == hierarchy.order().size());
  V3D_CODEC_CHECK(levels >= 2 && levels <= kMaxConfidenceLevels);
  RangeEncoder coder;
  V3D_CODEC_CHECK(code_confidences(coder, hierarchy, levels, references, state));
  return coder.take();
}

bool decode_confidences(std::span<const uint8_t> bytes, const VertexHierarchy& hierarchy,
                        size_t levels, References references, PulseState& state) {
  RangeDecoder coder(bytes);
  state.confidences.assign(hierarchy.order().size(), 0);
  return code_confidences(coder, hierarchy, levels, references, state) && coder.ended();
}

uint8_t confidence_level(uint8_t confidence, size_t levels) {
  if (confidence == 0) return 0;
  const size_t rounded = (2 * confidence * (levels - 1) + 255) / (2 * 255);
  return static_cast<uint8_t>(std::max(rounded, size_t{1}));
}

uint8_t confidence_of(uint8_t level, size_t levels) {
  return static_cast<uint8_t>((2 * 255 * level + (levels - 1)) / (2 * (levels - 1)));
}

}  // namespace v3d::codec
