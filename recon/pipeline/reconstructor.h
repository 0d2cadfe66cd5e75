// From a frame set to a coloured mesh and its compact frame: the whole chain, live and offline.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/mesh.h"
#include "base/studio_file.h"
#include "recon/hull/sparse_volume.h"
#include "recon/metrics/frame_quality.h"
#include "recon/surface/deform.h"
#include "recon/surface/pulse_views.h"

namespace v3d {

/// All cameras, one pulse. `frames` has masks and colour (see observe()); cameras that did not
/// deliver are not in it.
struct FrameSet {
  int64_t pulse = 0;
  std::vector<Frame> frames;
  RealtimeInstant exposure{};  ///< start, by the trigger's node: the pulse's edge; 0 when unknown
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
  double quality = -1;  ///< the score, which the compact frame tells
};

struct Reconstruction {
  int64_t pulse = 0;
  Mesh mesh;
  double volume_m3 = 0;              ///< occupied voxels times voxel volume
  std::vector<std::string> cameras;  ///< that took part
  std::vector<uint8_t> compact;
  FrameQuality quality;
  StageTimes times;
};

/// A frame set on its way through the stages.
struct FrameSetJob {
  FrameSetJob() = default;
  explicit FrameSetJob(FrameSet frame_set) : set(std::move(frame_set)) {}
  // Copies would point to the frames of the original.
  FrameSetJob(FrameSetJob&&) = default;
  FrameSetJob& operator=(FrameSetJob&&) = default;

  FrameSet set;
  std::vector<const Frame*>
      frames;           ///< of `set`, by camera of the rig; null: none that can be used
  SparseVolume volume;  ///< that the mesh is the surface of
  Reconstruction result;
};

/// Holds what is computed once per rig. The result is deterministic: the same frame sets, one after
/// the other, give the same bytes whatever the number of threads and the order of the frames, one
/// set at a time or in a FramePipeline.
class Reconstructor {
 public:
  /// Throws InputError when the grid needs more memory than there is (the message shows the
  /// arithmetic), and for deform options out of their ranges.
  Reconstructor(const Rig& rig, const ReconstructOptions& options);
  ~Reconstructor();
  /// Frames of cameras that are not in the rig, or whose mask has another size than the rig says,
  /// are left out. The mesh is the one that receivers decode from `compact`, to the bit; that is a
  /// key frame. Throws InputError when the surface outgrows a compact frame (4 million vertices).
  /// One caller at a time.
  Reconstruction reconstruct(FrameSet set);

  /// The same in two stages, in the caller's TBB arena: first the coloured mesh, all in parallel
  /// loops, then its quality and its compact frame, mostly one thread's work. One caller of each at
  /// a time; they may work on different sets at the same time. What is encoded is one sequence: a
  /// compact frame may need those before it since the last key frame.
  void make_mesh(FrameSetJob& work);
  void encode(FrameSetJob& work);
  /// The next set is encoded as a key frame: where one that was encoded did not reach its
  /// receivers.
  void begin_sequence();

  /// make_surface() of a pulse by itself, of any quality.
  void make_surface(FrameSetJob& work);
  /// make_mesh() in parts, for who has pulses before and after it; all but the colours require
  /// Quality::kHigh. The hull;
  void make_hull(FrameSetJob& work);
  /// what the cameras saw of it, and of its hollows;
  PulseViews make_views(FrameSetJob& work);
  /// the surface without colours, carved and deformed, which `now` is told;
  void make_surface(FrameSetJob& work, PulseViews& now,
                    std::span<const PulseViews* const> adjacent);
  /// smooth_over_time(); and the colours.
  void smooth_over_time(FrameSetJob& work, const PulseViews& now,
                        std::span<const PulseViews* const> adjacent) const;
  void make_colours(FrameSetJob& work) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
