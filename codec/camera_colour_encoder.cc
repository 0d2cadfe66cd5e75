#include <cmath>

#include "codec/byte_stream.h"
#include "codec/camera_colour_model.h"
#include "codec/camera_colours.h"
#include "codec/check.h"

namespace v3d::codec {
namespace {

/// Prepares what is coded of one camera.
class CameraAnalysis {
 public:
  CameraAnalysis(const CameraView& view, const CameraSurface& surface,
                 const CameraResiduals* before, std::span<const uint32_t> previous_vertices)
      : view_(view), surface_(surface), before_(before), previous_(previous_vertices) {}

  CameraInput run() {
    const uint32_t vertices = surface_.tree.vertices();
    CameraInput input;
    input.seen.resize(vertices);
    residuals_.resize(vertices);
    for (uint32_t v = 0; v < vertices; ++v) {
      const auto& [r, g, b, alpha] = view_.vertices[v];
      if (alpha == 0 || facing_class(surface_.normals[v], view_.axis) == 0) continue;
      input.seen[v] = 1;
      const LumaChroma colour = luma_chroma_of({r, g, b});
      for (size_t n = 0; n < 3; ++n)
        residuals_[v][n] = static_cast<float>(colour[n] - surface_.colours[v][n]);
    }
    drop_isolated(input.seen);
    input.groups.resize(vertices / kColourGroup + 1);
    for (uint32_t first = 0; first < vertices && before_ != nullptr; first += kColourGroup) {
      input.groups[first / kColourGroup] = predict_group(input, first);
    }
    transform(input);
    return input;
  }

 private:
  /// Drops vertices of which fewer than a third of the neighbours are seen: each would cost about a
  /// byte, and other cameras see them.
  void drop_isolated(std::vector<uint8_t>& seen) {
    std::vector<uint32_t> neighbours(seen.size()), seen_neighbours(seen.size());
    for (uint32_t v = 0; v < seen.size(); ++v) {
      for (const uint32_t u : surface_.known.of(v)) {
        ++neighbours[v], ++neighbours[u];
        seen_neighbours[v] += seen[u], seen_neighbours[u] += seen[v];
      }
    }
    for (uint32_t v = 0; v < seen.size(); ++v) {
      if (3 * seen_neighbours[v] >= neighbours[v]) continue;
      seen[v] = 0;
      residuals_[v] = {};
    }
  }

  const LumaChroma* previous(uint32_t vertex) const {
    const uint32_t then = previous_[vertex];
    if (then == kNoVertex || before_->vertices[then][3] == 0) return nullptr;
    return &before_->vertices[then];
  }

  /// Subtracts the residuals of the previous frame from those of a group where that makes them
  /// smaller.
  uint8_t predict_group(const CameraInput& input, uint32_t first) {
    const uint32_t end = std::min(first + kColourGroup, surface_.tree.vertices());
    double alone = 0, predicted = 0;
    for (uint32_t v = first; v < end; ++v) {
      const LumaChroma* const then = previous(v);
      if (input.seen[v] == 0 || then == nullptr) continue;
      for (size_t n = 0; n < 3; ++n) {
        const float left = residuals_[v][n] - static_cast<float>((*then)[n]);
        alone += double{residuals_[v][n]} * double{residuals_[v][n]};
        predicted += double{left} * double{left};
      }
    }
    if (predicted >= alone) return 0;
    for (uint32_t v = first; v < end; ++v) {
      const LumaChroma* const then = previous(v);
      if (input.seen[v] == 0 || then == nullptr) continue;
      for (size_t n = 0; n < 3; ++n) residuals_[v][n] -= static_cast<float>((*then)[n]);
    }
    return 1;
  }

  /// Weighted Haar transform along the tree.
  void transform(CameraInput& input) {
    const uint32_t vertices = surface_.tree.vertices();
    const auto nodes = surface_.tree.nodes();
    std::vector<float> counts(input.seen.begin(), input.seen.end());
    counts.resize(vertices + nodes.size());
    residuals_.resize(counts.size());
    input.differences.resize(nodes.size());
    for (size_t i = 0; i < nodes.size(); ++i) {
      const auto [low, high] = nodes[i];
      const float count = counts[low] + counts[high];
      counts[vertices + i] = count;
      if (count == 0) continue;
      for (size_t n = 0; n < 3; ++n) {
        input.differences[i][n] = residuals_[high][n] - residuals_[low][n];
        residuals_[vertices + i][n] =
            (counts[low] * residuals_[low][n] + counts[high] * residuals_[high][n]) / count;
      }
    }
    for (size_t n = 0; n < 3 && vertices > 0; ++n) input.mean[n] = double{residuals_.back()[n]};
  }

  const CameraView& view_;
  const CameraSurface& surface_;
  const CameraResiduals* const before_;
  std::span<const uint32_t> previous_;
  std::vector<std::array<float, 3>> residuals_;  ///< [vertex], then the means of the nodes
};

CodedCameras encode_with(int step, std::span<const CameraView> views,
                         std::span<const CameraInput> inputs, const CameraSurface& surface,
                         const PreviousCameras* previous) {
  CodedCameras coded;
  coded.step = step;
  coded.residuals.resize(views.size());
  const ColourSteps steps = camera_steps(step);
  RangeEncoder coder;
  CameraCode code(coder, surface, previous, steps);
  ByteWriter bytes;
  bytes.number(static_cast<uint8_t>(previous != nullptr));
  for (const uint8_t each : steps) bytes.number(each);
  for (size_t c = 0; c < views.size(); ++c) {
    coded.residuals[c].axis = views[c].axis;  // code.run() needs those of the earlier cameras
    for (const int16_t number : views[c].axis) bytes.number(number);
    code.run(c, inputs[c], coded.residuals);
  }
  bytes.bytes(coder.take());
  coded.bytes = bytes.take();
  return coded;
}

}  // namespace

CodedCameras encode_cameras(std::span<const CameraView> views, const CameraSurface& surface,
                            const PreviousCameras* previous, size_t max_bytes) {
  V3D_CODEC_CHECK(previous == nullptr || previous->cameras.size() == views.size());
  std::vector<CameraInput> inputs;
  for (size_t c = 0; c < views.size(); ++c) {
    V3D_CODEC_CHECK(views[c].vertices.size() == surface.tree.vertices());
    inputs.push_back(
        CameraAnalysis(views[c], surface, previous == nullptr ? nullptr : &previous->cameras[c],
                       previous == nullptr ? std::span<const uint32_t>() : previous->vertices)
            .run());
  }
  int fits = kMaxCameraStep, fails = kMinCameraStep - 1;
  CodedCameras best = encode_with(fits, views, inputs, surface, previous);
  while (best.bytes.size() <= max_bytes && fits - fails > std::max(1, fits / 16)) {
    const int step = fits - fails > fits / 2 ? std::max(fails + 1, fits / 2) : (fits + fails) / 2;
    CodedCameras coded = encode_with(step, views, inputs, surface, previous);
    if (coded.bytes.size() <= max_bytes) {
      fits = step;
      best = std::move(coded);
    } else {
      fails = step;
    }
  }
  return best;
}

}  // namespace v3d::codec
