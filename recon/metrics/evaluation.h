// How far a reconstructed surface is from the true one, and a picture from the photograph.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/mask.h"
#include "base/mesh.h"

namespace v3d {

struct SurfaceDistance {
  double accuracy_p50_mm = 0, accuracy_p90_mm = 0;  ///< from the reconstruction to the truth
  double completeness_p50_mm = 0,
         completeness_p90_mm = 0;  ///< from the truth to the reconstruction
  /// Harmonic mean of the parts of either surface that lie within the distance of the other, 0
  /// to 1.
  double f_score_2mm = 0, f_score_5mm = 0, f_score_10mm = 0;
  /// Parts of the truth that lie within the distance of the reconstruction.
  double covered_2mm = 0, covered_5mm = 0, covered_10mm = 0;
  /// Mean angle between the normal of the reconstruction and that of the nearest true point.
  double normal_error_deg = 0;
};

struct SurfaceDistanceOptions {
  int samples = 50'000;  ///< on either surface, spread evenly by area
  uint64_t seed = 1;
};

/// Distances are exact, from sampled points to the nearest triangle. Normals are interpolated from
/// the vertices, so that the steps of a lattice mesh count as the surface they stand for.
/// Deterministic for any number of threads. A mesh without area: all distances infinite, f-scores
/// 0, angle 180; unless both have none (then 0, 1, 0).
SurfaceDistance compare_surfaces(const Mesh& reconstructed, const Mesh& truth,
                                 const SurfaceDistanceOptions& options = {});

/// A reconstruction of two pulses in a row, held against each other as far as the truth stood still
/// (by no more than 0.2 mm, along the shortest way from surface to surface), and against the truth
/// as far as that moved (1 mm or more): less of the one must not be bought with more of the other.
struct SurfaceChange {
  double still = 0;  ///< part of the later reconstruction whose truth stood still
  /// From there to the earlier reconstruction, millimetres; 0 where nothing stood still.
  double flicker_p50_mm = 0, flicker_p90_mm = 0;
  double moving = 0;  ///< part whose truth moved
  /// From there to the truth, millimetres; 0 where nothing moved.
  double moving_p50_mm = 0, moving_p90_mm = 0;
};

/// A surface and its truth at one pulse, both borrowed.
struct MeshAndTruth {
  const Mesh* mesh;
  const Mesh* truth;
};

/// Points are chosen and distances measured as by compare_surfaces(). All 0 where one of the four
/// has no area.
SurfaceChange compare_in_time(const MeshAndTruth& before, const MeshAndTruth& now,
                              const SurfaceDistanceOptions& options = {});

/// Millimetres from every vertex of `mesh` to the nearest point of the truth; infinite where there
/// is none.
std::vector<double> vertex_distances_mm(const Mesh& mesh, const Mesh& truth);

/// Peak signal-to-noise ratio over the three channels of the pixels inside `where`, decibels;
/// infinite for equal pixels, and for an empty mask. Requires RGB8 images of the mask's size.
double psnr_db(ImageView a, ImageView b, const Mask& where);

/// Mean structural similarity of the luma over the pixels inside `where`, at most 1 (1 for an empty
/// mask). Wang, Bovik, Sheikh, Simoncelli 2004: Gaussian window of 11 pixels, sigma 1.5, K1 = 0.01,
/// K2 = 0.03; at the image border the window is cut and its weights add up to 1 again. Requires
/// RGB8 images of the mask's size.
double ssim(ImageView a, ImageView b, const Mask& where);

}  // namespace v3d
