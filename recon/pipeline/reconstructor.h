// Reconstruction of one frame set: hull, surface, texture, compact frame. Live and offline.
#pragma once

#include <tbb/task_arena.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "recon/metrics/frame_quality.h"
#include "recon/pipeline/frame_set.h"
#include "recon/pipeline/stages.h"

namespace v3d::recon {

struct ReconstructOptions {
  Box bounds;
  double voxel_m = 0.01;
  int min_views = 4;
  Quality quality = Quality::kLive;
  DeformOptions deform = {};  ///< for Quality::kHigh; its voxel_m and lattice are set
  /// For Quality::kMedium: LiveDeformer::run(), unless FrameSetJob::live_passes says otherwise.
  int live_passes = kDefaultLivePasses;
  int threads = 0;  ///< 0: one per core. The result does not depend on it.
};

/// Wall-clock milliseconds of each stage; negative where the stage did not run.
struct StageTimes {
  double intersect = -1, mesh = -1, deform = -1, smoothing = -1, texture = -1, encode = -1;
  double quality = -1;  ///< QualityMeter
};

inline double milliseconds_since(MonotonicInstant begin) {
  return 1000 * to_seconds(Monotonic::now() - begin);
}

struct Reconstruction {
  int64_t pulse = 0;
  Mesh mesh;
  double volume_m3 = 0;                     ///< occupied voxels times voxel volume
  int ghosts = 0;                           ///< number of components that GhostRemoval removed
  int live_passes = 0;                      ///< passes of LiveDeformStage that ran
  std::vector<std::string> cameras;         ///< cameras that took part
  std::vector<std::string> late_cameras{};  ///< of these, those with the frame of the next pulse
  std::vector<uint8_t> performers;          ///< of each vertex, 0: unknown; empty: not stated
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
  /// With Quality::kMedium; empty: ReconstructOptions::live_passes. 0 to kLivePasses.
  std::optional<int> live_passes;
  PassCheck may_run_pass;  ///< with Quality::kMedium: asked before each of these passes
  RigFrames frames;        ///< of `set`
  SparseVolume volume;     ///< the mesh is its surface
  Reconstruction result;
};

/// Runs the stages (recon/pipeline/stages.h) for one rig, measures their times and the quality of
/// the result. Deterministic: the same sequence of frame sets gives the same bytes for every thread
/// count and order of frames, one set at a time or in a FramePipeline.
class Reconstructor {
 public:
  /// Throws as HullStage, and for deform options out of range.
  Reconstructor(const Rig& rig, const ReconstructOptions& options);

  /// Reconstructs one set. Frames of unknown cameras, or with a mask of the wrong size, are
  /// ignored. The mesh has the bits that receivers decode from `compact`, which is a key frame.
  /// Throws as EncodeStage. One caller at a time.
  Reconstruction reconstruct(FrameSet set);

  // reconstruct() in two stages of a FramePipeline, in the caller's TBB arena. make_mesh() makes
  // the coloured mesh in parallel loops. encode() makes quality and compact frame, mostly in one
  // thread. One caller of each at a time; both may run at the same time on different jobs.
  void make_mesh(FrameSetJob& work);
  void encode(FrameSetJob& work);
  /// Encodes the next set as a key frame. Call it when an encoded frame did not reach its
  /// receivers.
  void begin_sequence() { encode_.restart(); }

  // The steps of make_mesh(), for callers that have adjacent pulses.
  void make_hull(FrameSetJob& work);
  void make_surface(FrameSetJob& work);  ///< hull and deformation of a single pulse
  void make_colours(FrameSetJob& work) const;
  DeformStage& deform_stage() { return *deform_; }  ///< requires Quality::kHigh

 private:
  const Rig rig_;
  tbb::task_arena arena_;  ///< for reconstruct()
  HullStage hull_;
  const int live_passes_;
  std::optional<DeformStage> deform_;           ///< for Quality::kHigh
  std::optional<LiveDeformStage> live_deform_;  ///< for Quality::kMedium
  const QualityMeter quality_;
  EncodeStage encode_;
};

}  // namespace v3d::recon
