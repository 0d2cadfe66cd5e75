// Reconstruction of a take in one process.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "daemon/recorded/take_frames.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"
#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::ctl {

/// Reconstructs the take and replaces its mesh.v3d and proxy.v3d when all frames are done
/// (replace_meshes()). They lack the pulses that are ReconstructReport::oversized.
/// Throws InputError for bad input, and when all pulses of the first shard are oversized, and
/// std::runtime_error for errors of the disk and after an interrupt; the old files then stay.
ReconstructReport reconstruct_take(const ReconstructRequest& request);

/// Reconstructs ranges of pulses. The mesh of a pulse depends on this pulse and its neighbours, its
/// bytes also on the frames since the last key frame: ranges that begin with a key frame have the
/// same bytes as in the whole take. One caller at a time.
class TakeReconstruction {
 public:
  /// `complete`: a result of with_defaults() for this take. Throws InputError as Reconstructor
  /// does.
  TakeReconstruction(const ReconstructRequest& complete, int threads, recorded::TakeFrames take);
  ~TakeReconstruction();

  /// Appends the meshes of `pulses` to `files`, the first as a key frame, and calls `on_frame`
  /// after each. A pulse whose surface or proxy is too large for a compact frame is in no file, and
  /// in the report. Requires files.proxy for a request with a proxy. Returns the measurements,
  /// without `seconds`. Requires increasing pulses, after those of earlier calls. Throws InputError
  /// for bad frames, and std::runtime_error for errors of the disk and after an interrupt.
  ReconstructReport make(std::span<const int64_t> pulses, PendingMeshes& files,
                         const std::function<void()>& on_frame);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::ctl
