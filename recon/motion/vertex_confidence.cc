#include "recon/motion/vertex_confidence.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

constexpr float kFullCameras = 3;
constexpr float kResidualM = 0.01F;  ///< at which the confidence falls to 1/e
constexpr uint8_t kMaxMissing = 10;  ///< pulses
constexpr float kLostFactor = 0.5F;  ///< of a patch that was missing for so long

float factor_of(float square_m2) { return std::exp(-square_m2 / (kResidualM * kResidualM)); }

/// Squared distance from `position` to the match, as far as the texture of the patch measures it.
float squared_slip(const PatchMatch& match, const Vector3f& position) {
  float sum = 0;
  for (size_t k = 0; k < match.directions.size(); ++k) {
    const float along = match.directions[k].dot(match.position - position);
    sum += match.precision[k] * along * along;
  }
  return sum;
}

}  // namespace

std::vector<float> VertexConfidence::patch_factors(const TemplateFit& fit) {
  const std::vector<Vector3f>& vertices = fit.vertices();
  const PatchMatches& matches = fit.patch_matches();
  missing_.resize(vertices.size(), 0);
  std::vector<float> factors(vertices.size(), 1);
  for (const PatchMatch& match : matches.found) {
    missing_[match.vertex] = 0;
    factors[match.vertex] = factor_of(squared_slip(match, vertices[match.vertex]));
  }
  for (const uint32_t vertex : matches.missing) {
    if (missing_[vertex] < kMaxMissing) ++missing_[vertex];
  }
  for (size_t v = 0; v < factors.size(); ++v) {
    factors[v] *= 1 - (1 - kLostFactor) * static_cast<float>(missing_[v]) / kMaxMissing;
  }
  return factors;
}

std::vector<uint8_t> VertexConfidence::of_pulse(const TemplateFit& fit,
                                                const NormalDisplacements& detail) {
  const std::vector<float> patches = patch_factors(fit);
  const std::vector<uint8_t>& cameras = fit.visible_cameras();
  std::vector<uint8_t> confidences(cameras.size(), 0);
  for (size_t v = 0; v < confidences.size(); ++v) {
    if (detail.weight[v] <= 0) continue;
    const uint32_t patch = fit.nearest_patch(v);
    const float seen = std::min(static_cast<float>(cameras[v]) / kFullCameras, 1.0F);
    const float texture = patch == SurfacePatches::kNoPatch ? 1.0F : patches[patch];
    const float factor = seen * texture * factor_of(detail.target[v] * detail.target[v]);
    confidences[v] = static_cast<uint8_t>(255 * factor + 0.5F);
  }
  return confidences;
}

}  // namespace v3d::recon
