// Errors of a reconstruction: surfaces, images, by visibility; and of a tracked surface.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::recon {

// Errors of a reconstruction: distances between surfaces, and similarity of images.

struct SurfaceDistance {
  double accuracy_p50_mm = 0, accuracy_p90_mm = 0;  ///< from the reconstruction to the truth
  double completeness_p50_mm = 0,
         completeness_p90_mm = 0;  ///< from the truth to the reconstruction
  /// Harmonic mean of the parts of both surfaces within the distance of the other one, 0 to 1.
  double f_score_2mm = 0, f_score_5mm = 0, f_score_10mm = 0;
  /// Parts of the true surface within the distance of the reconstruction.
  double covered_2mm = 0, covered_5mm = 0, covered_10mm = 0;
  /// The part within 10 mm of the largest connected component of the reconstruction. For the true
  /// surface of a slender part it shows whether the part is whole and joined to the rest.
  double covered_10mm_by_largest = 0;
  /// Mean angle between the normals of the reconstruction and of the nearest true points.
  double normal_error_deg = 0;
};

struct SurfaceDistanceOptions {
  int samples = 50'000;  ///< on each surface, distributed evenly by area
  uint64_t seed = 1;
};

/// Distances from sampled points to the nearest triangle, exact. Normals are interpolated from the
/// vertices, so that the steps of a lattice mesh do not count as errors. Meshes in metres.
/// Deterministic: independent of thread count.
///
/// A mesh without area has infinite distances, f-score 0 and angle 180. If both meshes have no
/// area, these are 0, 1 and 0.
SurfaceDistance compare_surfaces(const Mesh& reconstructed, const Mesh& truth,
                                 const SurfaceDistanceOptions& options = {});

/// Flicker and error of the reconstructions of two successive pulses. Flicker is measured where the
/// true surface did not move (at most 0.2 mm, along the shortest distance). The error is measured
/// where it moved (1 mm or more). So smoothing that reduces flicker but damages moving parts is
/// detected.
struct SurfaceChange {
  double still = 0;  ///< part of the later reconstruction where the truth did not move
  /// Distance from there to the earlier reconstruction, millimetres; 0 where all of the truth
  /// moved.
  double flicker_p50_mm = 0, flicker_p90_mm = 0;
  double moving = 0;  ///< part where the truth moved
  /// Distance from there to the truth, millimetres; 0 where nothing moved.
  double moving_p50_mm = 0, moving_p90_mm = 0;
};

/// A reconstruction and the true surface at one pulse, both borrowed.
struct MeshAndTruth {
  const Mesh* mesh;
  const Mesh* truth;
};

/// Points and distances as in compare_surfaces(). Empty when one of the four meshes has no area.
std::optional<SurfaceChange> compare_in_time(const MeshAndTruth& before, const MeshAndTruth& now,
                                             const SurfaceDistanceOptions& options = {});

/// Distance from each vertex of `mesh` to the nearest point of `truth`, millimetres; infinite when
/// `truth` has no triangles.
std::vector<double> vertex_distances_mm(const Mesh& mesh, const Mesh& truth);

/// Peak signal-to-noise ratio over the three channels of the pixels in `where`, decibels; infinite
/// for equal pixels and for an empty mask. Requires RGB8 images of the size of the mask.
double psnr_db(ImageView a, ImageView b, const Mask& where);

/// Mean structural similarity of the luma over the pixels in `where`, at most 1; 1 for an empty
/// mask. Gaussian window of 11 pixels, sigma 1.5, K1 = 0.01, K2 = 0.03; at an image border the
/// window is cut and its weights are normalised. Requires RGB8 images of the size of the mask.
/// Source: Wang, Bovik, Sheikh and Simoncelli, 2004.
double ssim(ImageView a, ImageView b, const Mask& where);

// Accuracy by visibility: separates errors of the reconstruction from points that too few cameras
// see.

/// Parts of two surfaces, 0 to 1. Points of the reconstruction are classified by the nearest point
/// of the true surface.
struct VisibilityFigures {
  double truth = 0;         ///< part of the true surface
  double truth_within = 0;  ///< of that, the part within the limit of the reconstruction
  double reconstructed = 0;
  double reconstructed_within = 0;
};

/// By the number of cameras that see the true point: none, one, two, three or more.
struct VisibilityReport {
  std::array<VisibilityFigures, 4> seen_by;

  /// The f-score if all points that at least `cameras` cameras see were correct.
  double f_score_if_right_from(size_t cameras) const;
};

/// A camera sees a point that projects into its image, faces it by less than 78 degrees, and is not
/// hidden by the true surface. `limit_m` is the largest correct distance, metres. Points as in
/// compare_surfaces(). All 0 when the truth has no area. When the reconstruction has none, the
/// parts of the truth are known and nothing of it is within the limit.
VisibilityReport compare_by_visibility(const Mesh& reconstructed, const Mesh& truth,
                                       std::span<const CameraModel> cameras, double limit_m,
                                       const SurfaceDistanceOptions& options = {});

// Errors of a tracked surface: how far points that it carries are from where they truly are.

/// Distances of carried points from their true positions.
struct EndPointError {
  int64_t points = 0;
  double p50_mm = 0, p90_mm = 0;
  /// The same along the true surface alone.
  double tangential_p50_mm = 0;
};

/// Carries points with the surfaces of successive pulses. World, metres. One caller at a time.
class CarriedPoints {
 public:
  /// A point farther than this from the first surface is not bound.
  static constexpr double kMaxDistanceM = 0.02;

  /// Binds each of `points` to the nearest point of `surface`: a triangle, barycentric weights, and
  /// an offset in the frame of the triangle.
  CarriedPoints(const Mesh& surface, std::vector<Eigen::Vector3f> points);

  const std::vector<Eigen::Vector3f>& positions() const { return positions_; }
  bool is_bound(size_t point) const { return bindings_[point].triangle != kUnbound; }
  int64_t bound() const;

  /// Moves the points to the next pulse of the same surface: the same triangles, other vertices.
  void follow(const Mesh& surface);
  /// Binds the points that were bound to the nearest points of another surface of the same pulse,
  /// at any distance, so that a lost point counts with its error.
  void change_surface(const Mesh& surface);
  /// As change_surface(), one pulse later: first moves the points on as between the last two
  /// pulses.
  void change_surface_later(const Mesh& surface);
  /// Moves the points to the nearest points of another surface, at any distance: nearest-point
  /// propagation.
  void move_to_nearest(const Mesh& surface);

 private:
  static constexpr uint32_t kUnbound = 0xFFFFFFFF;
  struct Binding {
    uint32_t triangle = kUnbound;
    std::array<double, 3> weights{};
    /// In the frame of the triangle: along its first edge, across it, along its normal.
    Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
  };
  void bind(const Mesh& surface, double max_distance_m);

  std::vector<Eigen::Vector3f> positions_, before_;
  std::vector<Binding> bindings_;
};

/// Error of the bound points where `chosen` is not 0. `normals`: unit normals of the true surface
/// at the points.
EndPointError end_point_error(const CarriedPoints& carried, std::span<const Eigen::Vector3f> truth,
                              std::span<const Eigen::Vector3f> normals,
                              std::span<const uint8_t> chosen);

/// Unit normals of `surface` at its point nearest to each of `points`; zero without triangles.
std::vector<Eigen::Vector3f> normals_at(const Mesh& surface,
                                        std::span<const Eigen::Vector3f> points);

}  // namespace v3d::recon
