// The stages of a reconstruction: silhouettes -> hull -> surface -> colours -> compact frame.
//
// Each stage passes on plain values (frames, a volume, a mesh), and can be used alone.
// Reconstructor (recon/pipeline/reconstructor.h) runs the stages of live reconstruction one after
// the other.
//
// All stages keep their working memory between calls, work in the caller's TBB arena, and are
// deterministic: results do not depend on the number of threads. One caller at a time for each
// object. Lengths are in metres, positions in the world frame.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/geometry/rigid_transform.h"
#include "codec/frame_codec.h"
#include "recon/hull/ghost_removal.h"
#include "recon/hull/intersect.h"
#include "recon/hull/slender_silhouettes.h"
#include "recon/hull/sparse_volume.h"
#include "recon/pipeline/frame_set.h"
#include "recon/surface/concavity_carving.h"
#include "recon/surface/deform.h"
#include "recon/surface/temporal_smoothing.h"

namespace v3d::recon {

/// A visual hull.
struct Hull {
  SparseVolume volume;
  int ghosts = 0;  ///< number of components that GhostRemoval removed
};

/// Silhouettes to a visual hull, and to its surface. Source: section 2.2 of the paper.
class HullStage {
 public:
  /// Throws InputError when the grid needs more memory than is available (the message shows the
  /// arithmetic) or is too far from the origin (require_precision()), and as Intersector.
  HullStage(const Rig& rig, const Box& bounds, double voxel_m, int min_views);

  const VoxelGrid& grid() const { return grid_; }
  /// Intersects the masks of `frames`, with their slender parts widened (SlenderSilhouettes), and
  /// removes ghosts.
  Hull intersect(const RigFrames& frames);
  /// The closed surface of a volume of this grid, without colours (MarchingCubes).
  Mesh surface(const SparseVolume& volume);

 private:
  VoxelGrid grid_;
  std::vector<SlenderSilhouettes> slender_;
  Intersector intersector_;
  GhostRemoval ghosts_;
  MarchingCubes marching_cubes_;
};

/// Carves concavities of a hull and moves its surface to where the images agree. Source: section
/// 2.3 of the paper.
class DeformStage {
 public:
  /// `grid` is that of the HullStage. `options.voxel_m` and `options.lattice` are set here. Throws
  /// InputError for options out of range.
  DeformStage(const Rig& rig, const VoxelGrid& grid, DeformOptions options);

  /// Lattice of the resulting vertices.
  const VertexLattice& lattice() const { return *options_.lattice; }

  /// Carves `volume` and replaces `surface`, from the images of a single pulse.
  void deform(const RigFrames& frames, SparseVolume& volume, Mesh& surface);

  /// For a sequence of pulses: first the views of each pulse, of its hull and the hull's surface.
  PulseViews views(const RigFrames& frames, const SparseVolume& volume, const Mesh& surface);
  /// Then deform() with the stereo samples of `adjacent` pulses. Adds the new surface to `now`.
  void deform(PulseViews& now, std::span<const PulseViews* const> adjacent, SparseVolume& volume,
              Mesh& surface);
  /// Then smooth_over_time() with the deformed surfaces of `adjacent` pulses.
  void smooth(const PulseViews& now, std::span<const PulseViews* const> adjacent,
              Mesh& surface) const;

 private:
  void carve(const SurfaceCameras& cameras, const StereoSamples& samples,
             std::span<const NeighbourSamples> adjacent, SparseVolume& volume, Mesh& surface);

  std::vector<CameraModel> models_;
  double voxel_m_;
  DeformOptions options_;
  Deformer deformer_;
  std::optional<ConcavityCarver> carver_;
  MarchingCubes marching_cubes_;
};

/// Moves the surface of a hull to where the images agree, within the live budget (LiveDeformer).
class LiveDeformStage {
 public:
  /// `grid` is that of the HullStage.
  LiveDeformStage(const Rig& rig, const VoxelGrid& grid);

  /// Lattice of the resulting vertices.
  const VertexLattice& lattice() const { return lattice_; }
  /// Deforms `surface` by the first `passes` passes, and asks `may_run` before each of them.
  /// Returns the passes that ran: see LiveDeformer::run().
  int deform(const RigFrames& frames, int passes, Mesh& surface, const PassCheck& may_run = {});

 private:
  std::vector<CameraModel> models_;
  double voxel_m_;
  VertexLattice lattice_;
  LiveDeformer deformer_;
};

enum class ColourDetail {
  kLive,  ///< Bayer images are interpolated at each sample
  kFull,  ///< images are demosaiced, and weights depend on resolution
};

/// Colours the vertices of `surface`, whose voxels have edges of `voxel_m` metres, by
/// colour_vertices().
void colour_surface(const Rig& rig, const RigFrames& frames, double voxel_m, ColourDetail detail,
                    Mesh& surface);

/// Metadata of a compact frame.
struct PulseMetadata {
  int64_t pulse = 0;
  RealtimeInstant exposure{};        ///< 0: unknown
  std::vector<std::string> cameras;  ///< that took part, ascending
  /// Of these, those whose frame of the next pulse was used, ascending.
  std::vector<std::string> late_cameras{};
  int missing = 0;      ///< number of cameras that did not
  double quality = 0;   ///< FrameQuality::silhouette_iou, 0 to 1
  int live_passes = 0;  ///< passes of LiveDeformStage
  /// The performer of each vertex, 0: unknown; empty: not stated.
  std::span<const uint8_t> performers{};
};

/// A surface that exceeds the limits of a compact frame.
class OversizedSurface : public InputError {
 public:
  using InputError::InputError;
};

/// Coloured surface to compact frame. The frames form a sequence: a frame may need those since the
/// last key frame. Format: docs/compact-frame.md.
class EncodeStage {
 public:
  /// `lattice`: of deformed vertices (DeformStage); empty where the surface is that of the volume.
  EncodeStage(const VoxelGrid& grid, const std::optional<VertexLattice>& lattice);

  /// Replaces the colours of `surface` by those that receivers decode. Throws OversizedSurface when
  /// the surface exceeds the limits of a compact frame (4 million vertices, 131,072 bricks); the
  /// next frame is then a key frame. Throws InputError with the field for other metadata than
  /// PulseMetadata describes; the sequence of frames does not change then.
  std::vector<uint8_t> encode(const PulseMetadata& metadata, const SparseVolume& volume,
                              Mesh& surface);
  /// The next frame becomes a key frame.
  void restart() { encoder_.restart(); }

 private:
  Eigen::Vector3d origin_;
  double voxel_m_;
  bool deformed_;
  codec::FrameEncoder encoder_;
};

}  // namespace v3d::recon
