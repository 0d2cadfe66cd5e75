// Tracking of a surface through the pulses of a segment: one template of constant topology follows
// the observed surfaces and images.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/pipeline/frame_set.h"
#include "recon/surface/template_windows.h"
#include "recon/texture/texture.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

/// Observation of one pulse: the mesh that was reconstructed from it alone, and its images.
struct ObservedPulse {
  int64_t pulse = 0;
  Mesh surface;  ///< world, metres; empty: an empty studio
  /// Frames with masks and images; none where only meshes are known. `cameras` refers to them.
  FrameSet frames;
  SurfaceCameras cameras;
};

/// Reads the i-th pulse of a take. Called by one thread at a time, mostly with i one more or one
/// less than before. The numbers of the pulses are ascending; gaps are lost pulses.
using PulseSource = std::function<std::shared_ptr<const ObservedPulse>(size_t i)>;

/// Colours of a surface in the images of the i-th pulse; none without images. Called after the
/// PulseSource has read this pulse, and before it reads another one.
using SurfaceColours = std::function<Texture(size_t i, const Mesh& surface)>;

struct TrackingOptions {
  size_t triangles = 30'000;      ///< of the template
  double node_spacing_m = 0.045;  ///< of the deformation graph
  double patch_spacing_m = 0.02;  ///< of SurfacePatches
  bool photometry = true;         ///< match SurfacePatches
  bool heterogeneity = true;      ///< learn where the surface is rigid and where it bends
  bool fusion = true;             ///< improve the template by what other pulses show
  /// A pulse ends the segment when more than this part of its observed surface, as far as cameras
  /// see it, is farther than `far_m` from the template; or more than `max_surplus` of the template
  /// from it. Meshes of single pulses differ by 2 to 5 and by 5 to 8 %, mostly in concavities.
  double max_far = 0.08, max_surplus = 0.12;
  double far_m = 0.02;
};

/// How well the template explains a pulse, before the displacements of single vertices.
struct PulseResidual {
  /// Distance from the observed surface, where at least two cameras see it, to the template,
  /// metres. All of it counts where no sample has two cameras.
  double median_m = 0, p90_m = 0;
  double far = 0;  ///< part of that observed surface beyond TrackingOptions::far_m
  /// Part of the seen vertices of the template as far from the observed surface: what is no longer
  /// there.
  double surplus = 0;
  /// Intersection over union of the template and the silhouettes, mean of the cameras; 1 without
  /// cameras.
  double silhouette_iou = 1;
  int64_t matched_patches = 0;
  double correlation = 0;  ///< median of the matched patches
};

/// One surface over several pulses.
struct TrackedSegment {
  std::vector<int64_t> pulses;  ///< increasing
  /// The last pulse belongs to the next segment, and shows how both surfaces correspond. There the
  /// surface may be wrong in parts.
  bool shares_last = false;
  size_t key = 0;  ///< index of the pulse whose mesh became the template
  Mesh surface;    ///< the template: triangles, colours; vertices at rest
  std::vector<std::vector<Eigen::Vector3f>> positions;  ///< [pulse][vertex], world, metres
  /// [pulse][vertex], by VertexConfidence: 0 predicted by the neighbours alone, up to 255 confirmed
  /// by the mesh and the images of several cameras.
  std::vector<std::vector<uint8_t>> confidences;
  std::vector<PulseResidual> residuals;  ///< by pulse
  /// [pulse][vertex], steadied over the pulses by ColourFilter; no vertices for a pulse without
  /// images. Empty without SurfaceColours.
  std::vector<std::vector<Rgb8>> colours;
};

/// Tracks from pulse `key` of `source` forward to `end` - 1 and backward to `begin`, or until the
/// template no longer explains a pulse; then one pulse more as TrackedSegment::shares_last, if it
/// is before `limit`. A pulse without a surface ends the segment, too. `colours` may be null. They
/// are those of the surface before it is smoothed over time, which is nearer to the images of its
/// pulse. Requires begin <= key < end <= limit and a key pulse with a surface.
///
/// Works in the caller's TBB arena. Deterministic: independent of thread count.
///
/// Source: Li, Adams, Guibas and Pauly, Robust single-view geometry and motion reconstruction,
/// SIGGRAPH Asia 2009 (deformation graph, relaxed rigidity, detail after the graph); Takai et al.
/// section 2.3 and its references 15 and 16 (heterogeneous deformation).
TrackedSegment track_segment(const PulseSource& source, size_t begin, size_t key, size_t end,
                             size_t limit, const TrackingOptions& options,
                             const SurfaceColours& colours = nullptr);

/// Positions and unit normals of vertices of a surface, world, metres.
struct SurfaceSamples {
  std::vector<Eigen::Vector3f> positions, normals;
};
/// Every n-th vertex.
SurfaceSamples every_nth(const Mesh& mesh, std::span<const Eigen::Vector3f> normals, size_t n);

/// The number of cameras that see each position: it is not far behind the surface in `depths`, and
/// faces the camera. Works in the caller's TBB arena.
std::vector<uint8_t> visible_camera_counts(std::span<const Eigen::Vector3f> positions,
                                           std::span<const Eigen::Vector3f> normals,
                                           const SurfaceCameras& cameras,
                                           std::span<const DepthBuffer> depths);

/// The mesh of a pulse, ready for queries. Immutable; any thread.
class ObservedSurface {
 public:
  explicit ObservedSurface(std::shared_ptr<const ObservedPulse> pulse);

  const ObservedPulse& pulse() const { return *pulse_; }
  const Mesh& mesh() const { return pulse_->surface; }
  const std::vector<Eigen::Vector3f>& normals() const { return normals_; }

  struct Nearest {
    Eigen::Vector3f position, normal;
  };
  /// The nearest point; empty when it is farther than `radius_m`.
  std::optional<Nearest> nearest(const Eigen::Vector3f& position, double radius_m) const;
  /// Distance to the nearest point, metres; infinite without a surface.
  double distance(const Eigen::Vector3d& position) const;

 private:
  std::shared_ptr<const ObservedPulse> pulse_;
  std::vector<Eigen::Vector3f> normals_;
  NearestTriangle tree_;
};

}  // namespace v3d::recon
