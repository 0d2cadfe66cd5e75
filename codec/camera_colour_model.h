// Code of the residuals of one camera, shared by encoder and decoder. docs/compact-frame.md is
// normative.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "codec/camera_colours.h"
#include "codec/colour_model.h"
#include "codec/entropy_coder.h"

namespace v3d::codec {

/// Steps of luma, Co and Cg for a step of luma: the same share of the error of red, green and blue.
inline ColourSteps camera_steps(int luma) {
  return {static_cast<uint8_t>(luma), static_cast<uint8_t>(5 * luma / 2),
          static_cast<uint8_t>(2 * luma)};
}

/// Fixed-point numbers of the transform.
inline constexpr int kFractionBits = 8;
inline constexpr int32_t kMaxMean = 1023 << kFractionBits;
inline constexpr int64_t kMaxDifference = 2047 << kFractionBits;

/// How much a vertex faces a camera, by the cosine between its inward normal and the axis of the
/// camera: 0: not, 1: below 0.2, 2: below 0.4, 3.
inline int facing_class(const std::array<double, 3>& normal, const CameraAxis& axis) {
  double inward = 0, normal2 = 0, axis2 = 0;
  for (size_t n = 0; n < 3; ++n) {
    const double along = axis[n];
    inward -= normal[n] * along;
    normal2 += normal[n] * normal[n];
    axis2 += along * along;
  }
  if (!(inward > 0)) return 0;
  const double cosine2 = inward * inward, one = normal2 * axis2;
  return cosine2 < 0.04 * one ? 1 : cosine2 < 0.16 * one ? 2 : 3;
}

/// Step of the difference of two means over `low` and `high` vertices, in fixed-point numbers.
/// With it the error of every vertex is the same as if the transform were orthonormal.
inline int64_t difference_step(int step, uint32_t low, uint32_t high) {
  const double of_low = low, of_high = high;
  const double steps = step * std::sqrt((of_low + of_high) / (of_low * of_high));
  return std::max(int64_t{1}, static_cast<int64_t>(steps * (1 << kFractionBits) + 0.5));
}
/// The same for the mean of all `vertices`.
inline int64_t mean_step(int step, uint32_t vertices) {
  const double steps = step / std::sqrt(static_cast<double>(vertices));
  return std::max(int64_t{1}, static_cast<int64_t>(steps * (1 << kFractionBits) + 0.5));
}

/// The three coefficients of a node, in steps.
using Coefficients = std::array<int, 3>;

/// Models of the coefficients.
class CoefficientModels {
 public:
  static constexpr size_t kLevels = 14, kParents = 3, kOthers = 4;

  struct Context {
    size_t level;   ///< number of binary digits of the number of vertices
    size_t parent;  ///< of the nearest coefficients above: 0 all are 0, 1 all at most 1, 2
    size_t others;  ///< of the earlier cameras, see CameraCode
    int near;       ///< coefficient of luma of the nearest camera, at most 2 either way
  };

  /// `wanted()` returns the coefficients; the decoder does not call it.
  template <class Coder, class Wanted>
  Coefficients code(Coder& coder, const Context& at, const Wanted& wanted) {
    Coefficients k{};
    if constexpr (!std::is_same_v<Coder, RangeDecoder>) k = wanted();
    const bool some = k[0] != 0 || k[1] != 0 || k[2] != 0;
    if (!coder.bit(some_[at.level][at.parent][at.others][std::abs(at.near)], some)) return {};
    BitModel& sign = sign_[at.near > 0 ? 1 : at.near < 0 ? 2 : 0];
    k[0] = luma_[at.parent].code(coder, k[0],
                                 [&](bool negative) { return coder.bit(sign, negative); });
    const size_t luma = std::min(std::abs(k[0]), 2);
    k[1] = co_[luma].code(coder, k[1]);
    const size_t co = std::min(std::abs(k[1]), 1);
    k[2] = cg_[luma][co].code(coder, k[2]);
    return k;
  }

 private:
  using ByNear = std::array<BitModel, 3>;
  std::array<std::array<std::array<ByNear, kOthers>, kParents>, kLevels> some_;
  std::array<BitModel, 3> sign_;  ///< of luma: [near is 0, positive, negative]
  std::array<ResidualModel, kParents> luma_;
  std::array<ResidualModel, 3> co_;
  std::array<std::array<ResidualModel, 2>, 3> cg_;
};

/// Input of the encoder for one camera. The decoder ignores it.
struct CameraInput {
  std::vector<uint8_t> seen;     ///< [vertex]
  std::vector<uint8_t> groups;   ///< [group]: predicted from the previous frame
  std::array<double, 3> mean{};  ///< of all vertices
  std::vector<std::array<float, 3>>
      differences;  ///< [node]: mean of the high child less the low one
};

/// The earlier camera whose axis has the greatest scalar product with that of the last one; of
/// equal ones the first. Without any, the last one.
inline size_t nearest_camera(std::span<const CameraResiduals> cameras) {
  const CameraAxis& own = cameras.back().axis;
  size_t nearest = cameras.size() - 1;
  int64_t greatest = std::numeric_limits<int64_t>::min();
  for (size_t c = 0; c + 1 < cameras.size(); ++c) {
    int64_t product = 0;
    for (size_t n = 0; n < 3; ++n) product += int64_t{own[n]} * cameras[c].axis[n];
    if (product > greatest) {
      greatest = product;
      nearest = c;
    }
  }
  return nearest;
}

/// Codes the cameras of a frame one after the other. `Coder` is RangeEncoder or RangeDecoder.
template <class Coder>
class CameraCode {
 public:
  CameraCode(Coder& coder, const CameraSurface& surface, const PreviousCameras* previous,
             const ColourSteps& steps)
      : coder_(coder),
        surface_(surface),
        previous_(previous),
        steps_(steps),
        vertices_(surface.tree.vertices()),
        others_(surface.tree.nodes().size(), 0) {}

  /// Codes camera number `camera`, whose axis is set. False when the end of the bytes was exceeded.
  /// `all`: of all cameras; the earlier ones are coded.
  bool run(size_t camera, const CameraInput& input, std::span<CameraResiduals> all) {
    CameraResiduals& residuals = all[camera];
    const size_t near = nearest_camera(all.first(camera + 1));
    near_ = near == camera ? nullptr : all[near].vertices.data();
    lumas_.emplace_back(surface_.tree.nodes().size(), 0);
    near_lumas_ = near == camera ? nullptr : lumas_[near].data();
    before_ = previous_ == nullptr ? nullptr : previous_->cameras[camera].vertices.data();
    residuals.vertices.assign(vertices_, {});
    if (vertices_ == 0) return true;
    code_seen(input, residuals);
    if (overran()) return false;
    if (before_ != nullptr) code_groups(input, residuals);
    if (overran()) return false;
    return code_coefficients(input, residuals);
  }

 private:
  static constexpr bool kDecodes = std::is_same_v<Coder, RangeDecoder>;
  static constexpr uint8_t kNotCoded = 0, kAllZero = 1, kOnce = 2, kOften = 3;

  bool overran() const {
    if constexpr (kDecodes) return coder_.overran();
    return false;
  }
  /// The residual of the vertex in the previous frame; null when the camera does not see it there.
  const LumaChroma* previous(uint32_t vertex) const {
    const uint32_t then = before_ == nullptr ? kNoVertex : previous_->vertices[vertex];
    return then == kNoVertex || before_[then][3] == 0 ? nullptr : &before_[then];
  }

  void code_seen(const CameraInput& input, CameraResiduals& residuals);
  void code_groups(const CameraInput& input, CameraResiduals& residuals);
  bool code_coefficients(const CameraInput& input, CameraResiduals& residuals);
  void count_seen(const CameraResiduals& residuals);
  void code_mean(const CameraInput& input);
  void code_node(uint32_t node, const CameraInput& input);
  void split(uint32_t node, const Coefficients& k);
  void pass_on(uint32_t node, uint32_t child) {
    means_[child] = means_[vertices_ + node];
    active_[child] = active_[vertices_ + node];
  }
  static int quantised(double value, int64_t step) {
    constexpr double kRounding = 1.0 / 3;  // less than half: zeros are cheap
    const auto steps = static_cast<int>(
        std::abs(value) * (1 << kFractionBits) / static_cast<double>(step) + kRounding);
    return value < 0 ? -steps : steps;
  }

  Coder& coder_;
  const CameraSurface& surface_;
  const PreviousCameras* const previous_;
  const ColourSteps steps_;
  const uint32_t vertices_;
  const LumaChroma* before_ = nullptr;  ///< residuals of the camera in the previous frame

  const LumaChroma* near_ = nullptr;        ///< residuals of the nearest earlier camera
  const int8_t* near_lumas_ = nullptr;      ///< coefficients of luma of this camera
  std::vector<std::vector<int8_t>> lumas_;  ///< [camera][node]: at most 2 either way

  using ByBefore = std::array<std::array<BitModel, 3>, 3>;
  std::array<std::array<ByBefore, 5>, 3> seen_models_;  ///< [facing][known][before][near]
  std::array<BitModel, 2> group_models_;                ///< [the group before]
  std::array<ResidualModel, 3> mean_models_;
  CoefficientModels models_;
  std::vector<uint8_t> others_;   ///< [node]: coefficients of the earlier cameras
  std::vector<uint32_t> counts_;  ///< [vertex or vertices + node]: vertices that the camera sees
  std::vector<std::array<int32_t, 3>> means_;  ///< likewise: fixed-point means of the residuals
  std::vector<uint8_t> active_;                ///< likewise: CoefficientModels::Context::parent
};

template <class Coder>
void CameraCode<Coder>::code_seen(const CameraInput& input, CameraResiduals& residuals) {
  for (uint32_t v = 0; v < vertices_; ++v) {
    const int facing = facing_class(surface_.normals[v], residuals.axis);
    if (facing == 0) continue;
    size_t known = 0;
    for (const uint32_t u : surface_.known.of(v))
      known += static_cast<size_t>(residuals.vertices[u][3]);
    size_t before = 0;
    if (before_ != nullptr && previous_->vertices[v] != kNoVertex)
      before = previous(v) != nullptr ? 2 : 1;
    const size_t near = near_ == nullptr ? 0 : static_cast<size_t>(1 + near_[v][3]);
    BitModel& model = seen_models_[static_cast<size_t>(facing - 1)][known][before][near];
    residuals.vertices[v][3] = coder_.bit(model, !kDecodes && input.seen[v] != 0) ? 1 : 0;
    if (v % kColourGroup == 0 && overran()) return;
  }
}

template <class Coder>
void CameraCode<Coder>::code_groups(const CameraInput& input, CameraResiduals& residuals) {
  bool last = false;
  for (uint32_t first = 0; first < vertices_; first += kColourGroup) {
    const uint32_t end = std::min(first + kColourGroup, vertices_);
    bool possible = false;
    for (uint32_t v = first; v < end && !possible; ++v) {
      possible = residuals.vertices[v][3] != 0 && previous(v) != nullptr;
    }
    if (!possible) continue;
    last = coder_.bit(group_models_[last ? 1 : 0],
                      !kDecodes && input.groups[first / kColourGroup] != 0);
    for (uint32_t v = first; v < end && last; ++v) {
      const LumaChroma* const then = previous(v);
      if (residuals.vertices[v][3] != 0 && then != nullptr) residuals.vertices[v] = *then;
    }
  }
}

template <class Coder>
bool CameraCode<Coder>::code_coefficients(const CameraInput& input, CameraResiduals& residuals) {
  count_seen(residuals);
  if (counts_.back() == 0) return true;
  code_mean(input);
  constexpr uint32_t kChecked = 4096;  // nodes between two checks for the end of the bytes
  for (auto node = static_cast<uint32_t>(surface_.tree.nodes().size()); node-- > 0;) {
    if (counts_[vertices_ + node] > 0) code_node(node, input);
    if (node % kChecked == 0 && overran()) return false;
  }
  for (uint32_t v = 0; v < vertices_; ++v) {
    LumaChroma& residual = residuals.vertices[v];
    if (residual[3] == 0) continue;
    for (size_t n = 0; n < 3; ++n) {
      constexpr int kHalf = 1 << (kFractionBits - 1);
      const int value = residual[n] + ((means_[v][n] + kHalf) >> kFractionBits);
      residual[n] = static_cast<int16_t>(std::clamp(value, -510, 510));
    }
  }
  return true;
}

template <class Coder>
void CameraCode<Coder>::count_seen(const CameraResiduals& residuals) {
  const auto nodes = surface_.tree.nodes();
  counts_.resize(vertices_ + nodes.size());
  means_.resize(counts_.size());
  active_.resize(counts_.size());
  for (uint32_t v = 0; v < vertices_; ++v)
    counts_[v] = static_cast<uint32_t>(residuals.vertices[v][3]);
  for (size_t n = 0; n < nodes.size(); ++n)
    counts_[vertices_ + n] = counts_[nodes[n].low] + counts_[nodes[n].high];
}

template <class Coder>
void CameraCode<Coder>::code_mean(const CameraInput& input) {
  active_.back() = 2;
  for (size_t n = 0; n < 3; ++n) {
    const int64_t step = mean_step(steps_[n], counts_.back());
    const int k = mean_models_[n].code(coder_, kDecodes ? 0 : quantised(input.mean[n], step));
    means_.back()[n] = static_cast<int32_t>(std::clamp<int64_t>(k * step, -kMaxMean, kMaxMean));
  }
}

template <class Coder>
void CameraCode<Coder>::code_node(uint32_t node, const CameraInput& input) {
  const uint32_t low = surface_.tree.nodes()[node].low, high = surface_.tree.nodes()[node].high;
  if (counts_[low] == 0) return pass_on(node, high);
  if (counts_[high] == 0) return pass_on(node, low);
  const uint32_t count = counts_[vertices_ + node];
  const CoefficientModels::Context at{
      .level = std::min(static_cast<size_t>(std::bit_width(count)), CoefficientModels::kLevels) - 1,
      .parent = active_[vertices_ + node],
      .others = others_[node],
      .near = near_lumas_ == nullptr ? 0 : near_lumas_[node]};
  const Coefficients k = models_.code(coder_, at, [&] {
    Coefficients steps;
    for (size_t n = 0; n < 3; ++n) {
      steps[n] = quantised(double{input.differences[node][n]},
                           difference_step(steps_[n], counts_[low], counts_[high]));
    }
    return steps;
  });
  split(node, k);
}

template <class Coder>
void CameraCode<Coder>::split(uint32_t node, const Coefficients& k) {
  const auto [low, high] = surface_.tree.nodes()[node];
  const int largest = std::max({std::abs(k[0]), std::abs(k[1]), std::abs(k[2])});
  active_[low] = active_[high] = static_cast<uint8_t>(std::min(largest, 2));
  const uint8_t more = others_[node] >= kOnce ? kOften : kOnce;
  lumas_.back()[node] = static_cast<int8_t>(std::clamp(k[0], -2, 2));
  others_[node] = largest > 0 ? more : std::max(others_[node], kAllZero);
  if (largest == 0) {
    means_[low] = means_[high] = means_[vertices_ + node];
    return;
  }
  const uint64_t share = (uint64_t{counts_[high]} << 16) / (counts_[low] + counts_[high]);
  for (size_t n = 0; n < 3; ++n) {
    const int64_t step = difference_step(steps_[n], counts_[low], counts_[high]);
    const int64_t difference = std::clamp(k[n] * step, -kMaxDifference, kMaxDifference);
    const int64_t lower =
        means_[vertices_ + node][n] - (static_cast<int64_t>(share) * difference >> 16);
    means_[low][n] = static_cast<int32_t>(std::clamp<int64_t>(lower, -kMaxMean, kMaxMean));
    means_[high][n] =
        static_cast<int32_t>(std::clamp<int64_t>(lower + difference, -kMaxMean, kMaxMean));
  }
}

}  // namespace v3d::codec
