// Reconstruction of one frame set: hull, surface, texture, compact frame. Live and offline.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/config/studio_file.h"
#include "base/geometry/box.h"
#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/frame.h"
#include "recon/hull/sparse_volume.h"
#include "recon/metrics/frame_quality.h"
#include "recon/surface/deform.h"
#include "recon/surface/pulse_views.h"

namespace v3d {

/// The frames of one pulse. `frames` have masks and colours (see observe()); cameras that did not
/// deliver are left out.
struct FrameSet {
  int64_t pulse = 0;
  std::vector<Frame> frames;
  RealtimeInstant exposure{};  ///< start, by the trigger's node: edge of the pulse; 0: unknown
};

struct ReconstructOptions {
  Box bounds;
  double voxel_m = 0.01;
  int min_views = 4;
  Quality quality = Quality::kLive;
  DeformOptions deform = {};  ///< for Quality::kHigh; its voxel_m and lattice are set
  int threads = 0;            ///< 0: one per core. The result does not depend on it.
};

/// Wall-clock milliseconds of each stage; negative where the stage did not run.
struct StageTimes {
  double intersect = -1, mesh = -1, deform = -1, smoothing = -1, texture = -1, encode = -1;
  double quality = -1;  ///< QualityMeter
};

struct Reconstruction {
  int64_t pulse = 0;
  Mesh mesh;
  double volume_m3 = 0;              ///< occupied voxels times voxel volume
  int ghosts = 0;                    ///< number of components that GhostRemoval removed
  std::vector<std::string> cameras;  ///< cameras that took part
  std::vector<uint8_t> compact;
  FrameQuality quality;
  StageTimes times;
};

/// A frame set and its intermediate results on the way through the stages.
struct FrameSetJob {
  FrameSetJob() = default;
  explicit FrameSetJob(FrameSet frame_set) : set(std::move(frame_set)) {}
  // Copies would point to the frames of the original.
  FrameSetJob(FrameSetJob&&) = default;
  FrameSetJob& operator=(FrameSetJob&&) = default;

  FrameSet set;
  std::vector<const Frame*> frames;  ///< of `set`, by camera of the rig; null: no usable frame
  SparseVolume volume;               ///< the mesh is its surface
  Reconstruction result;
};

/// Holds what is computed once per rig. Deterministic: the same sequence of frame sets gives the
/// same bytes for every thread count and order of frames, one set at a time or in a FramePipeline.
class Reconstructor {
 public:
  /// Throws InputError when the grid needs more memory than is available (the message shows the
  /// arithmetic), and for deform options out of range.
  Reconstructor(const Rig& rig, const ReconstructOptions& options);
  ~Reconstructor();
  /// Reconstructs one set. Frames of unknown cameras, or with a mask of the wrong size, are
  /// ignored. The mesh has the bits that receivers decode from `compact`, which is a key frame.
  ///
  /// Throws InputError when the surface exceeds the limits of a compact frame (4 million vertices).
  /// One caller at a time.
  Reconstruction reconstruct(FrameSet set);

  /// reconstruct() in two stages, in the caller's TBB arena. make_mesh() makes the coloured mesh in
  /// parallel loops. encode() makes quality and compact frame, mostly in one thread. One caller of
  /// each at a time; both may run at the same time on different jobs. The encoded frames form a
  /// sequence: a frame may need those since the last key frame.
  void make_mesh(FrameSetJob& work);
  void encode(FrameSetJob& work);
  /// Encodes the next set as a key frame. Call it when an encoded frame did not reach its
  /// receivers.
  void begin_sequence();

  /// The surface of a single pulse, without colours, of any quality.
  void make_surface(FrameSetJob& work);
  /// The steps of make_mesh(), for callers that have adjacent pulses. All except make_colours()
  /// require Quality::kHigh. make_hull() makes volume and surface of the hull.
  void make_hull(FrameSetJob& work);
  /// Cameras and stereo samples of the hull. Call after make_hull().
  PulseViews make_views(FrameSetJob& work);
  /// Carves and deforms the surface with the samples of `adjacent` pulses, and passes the result to
  /// now.set_surface(). No colours.
  void make_surface(FrameSetJob& work, PulseViews& now,
                    std::span<const PulseViews* const> adjacent);
  /// v3d::smooth_over_time() on the mesh of the job.
  void smooth_over_time(FrameSetJob& work, const PulseViews& now,
                        std::span<const PulseViews* const> adjacent) const;
  void make_colours(FrameSetJob& work) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
