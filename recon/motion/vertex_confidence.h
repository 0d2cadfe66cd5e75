// Confidence of the vertices of a tracked surface: how well a pulse confirms their positions.
#pragma once

#include <cstdint>
#include <vector>

#include "recon/motion/template_fit.h"

namespace v3d::recon {

/// Confidences of the vertices at ascending pulses of a segment. Each is 255 times the product of
///   - a third of the number of cameras that see the vertex, at most 1;
///   - exp(-(r / 10 mm)^2), where r is the displacement along the normal from the fitted graph to
///     the observed surface. Without one the vertex is only predicted, and the factor is 0;
///   - exp(-(s / 10 mm)^2), where s is the distance of the nearest patch from where it was found,
///     in the directions of its texture;
///   - 1 less a twentieth for each pulse since the nearest patch was found last at which a camera
///     shows it whole, at most ten: there the surface has probably slid.
/// The last two are 1 where the nearest patch was never learnt, and without images. One thread.
class VertexConfidence {
 public:
  /// Of the next pulse, after TemplateFit::fit(). `detail`: its displacements at this pulse.
  std::vector<uint8_t> of_pulse(const TemplateFit& fit, const NormalDisplacements& detail);

 private:
  /// The factor of each patch, by its vertex.
  std::vector<float> patch_factors(const TemplateFit& fit);

  std::vector<uint8_t> missing_;  ///< by the vertex of a patch: successive pulses without a match
};

}  // namespace v3d::recon
