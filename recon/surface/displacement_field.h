// A smooth field of displacements along the vertex normals. It follows the correlation of the
// images where that is clear, and the neighbours where it is not.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/surface/template_windows.h"

namespace v3d::recon {

/// Data term of the silhouettes for one vertex: displacements to their outlines, weighted by the
/// number of cameras.
struct OutlinePull {
  float weight = 0;
  float sum_m = 0;  ///< weight times displacement along the normal, metres
};

struct DisplacementFieldOptions {
  float first = -8;         ///< steps at which the profiles begin
  float step_m = 0;         ///< metres of a step
  float smoothness = 0.3F;  ///< weight of the neighbours against the data terms, 0 to about 0.5
  float photometric = 1;    ///< factor of those weights
  float coupling = 0.015F;  ///< correlation that one squared step from the field costs
  int sweeps = 8;           ///< two or more
};

/// Alternates two steps, from a weak to a strict coupling. First every vertex picks the best depth
/// of its profile near the field, refined by a parabola. Then Jacobi steps smooth the field
/// through these picks and the pulls of the outlines.
///
/// Keeps its memory. Works in the caller's TBB arena. Deterministic: independent of thread count
/// and instruction set.
///
/// Source: Newcombe, Lovegrove and Davison, DTAM, ICCV 2011, section 2.2.3, applied to a mesh.
class DisplacementField {
 public:
  using Values = NeighbourRows::Values;

  /// Data terms of a group of vertices, constant over all sweeps. A vertex without a profile has
  /// zeros.
  struct DataTerms {
    std::array<Values, kDepthSteps> profile;
    Values mean;  ///< of the profile
    Values pull_weight, pull_steps;
  };
  /// Target displacements of the data terms: weight, and steps times weight.
  struct Targets {
    Values weight, steps;
  };

  /// One displacement per vertex, metres. `known` is 1 for vertices that have a profile. The result
  /// is valid until the next call.
  std::span<const float> solve(const NeighbourRows& neighbours,
                               std::span<const DepthProfile> profiles,
                               std::span<const uint8_t> known, std::span<const OutlinePull> pulls,
                               const DisplacementFieldOptions& options);

 private:
  void gather_terms(std::span<const DepthProfile> profiles, std::span<const uint8_t> known,
                    std::span<const OutlinePull> pulls, float step_m);

  std::vector<DataTerms> terms_;
  std::vector<Targets> targets_;
  /// Steps; with one additional entry, always 0, for neighbours that do not exist.
  std::vector<float> field_, next_;
};

}  // namespace v3d::recon
