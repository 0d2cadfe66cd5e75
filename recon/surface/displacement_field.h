// One number per vertex: how far it should move along its normal. Finds the field that follows the
// correlation of the pictures where that is clear, and the neighbours where it is not.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/mesh/neighbours.h"
#include "recon/surface/correlation.h"

namespace v3d {

/// What the silhouettes want of a vertex: the mean way, weighted by the number of cameras.
struct OutlinePull {
  float weight = 0;
  float sum_m = 0;  ///< weight times the way along the normal, metres
};

struct DisplacementFieldOptions {
  float first = -8;         ///< steps at which the profiles begin
  float step_m = 0;         ///< metres of a step
  float smoothness = 0.3F;  ///< of the field, against the photometric weights (0 to about 0.5)
  float photometric = 1;    ///< factor of those weights
  float coupling = 0.015F;  ///< correlation given up for a step away from the neighbours
  int sweeps = 8;           ///< two or more
};

/// Alternates, coarse to strict: every vertex picks the best depth of its profile near the field,
/// refined below a step by a parabola; the field becomes a smooth one through these picks and the
/// outlines' pulls. (The scheme of Newcombe, Lovegrove and Davison, DTAM, ICCV 2011, section 2.2.3,
/// on a mesh.) Keeps its memory. Works in the caller's TBB arena; the result does not depend on the
/// number of threads. Vectorised for the processor it runs on; every processor gives the same bits.
class DisplacementField {
 public:
  using Values = NeighbourRows::Values;

  /// What a group of vertices wants, the same in all sweeps. A profile of zeros wants nothing.
  struct DataTerms {
    std::array<Values, kDepthSteps> profile;
    Values mean;  ///< of the profile
    Values pull_weight, pull_steps;
  };
  /// Where its vertices are drawn to, steps times weight.
  struct Targets {
    Values weight, steps;
  };

  /// `known`: vertices that have a profile. The field in metres, one number per vertex, lives until
  /// the next call.
  std::span<const float> solve(const NeighbourRows& neighbours,
                               std::span<const DepthProfile> profiles,
                               std::span<const uint8_t> known, std::span<const OutlinePull> pulls,
                               const DisplacementFieldOptions& options);

 private:
  void gather_terms(std::span<const DepthProfile> profiles, std::span<const uint8_t> known,
                    std::span<const OutlinePull> pulls, float step_m);

  std::vector<DataTerms> terms_;
  std::vector<Targets> targets_;
  /// Steps. One more than there are vertices in `neighbours`: the field of nobody, always 0.
  std::vector<float> field_, next_;
};

}  // namespace v3d
