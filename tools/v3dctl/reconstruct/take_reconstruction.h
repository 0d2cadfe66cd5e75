// The frames of a take on their way to mesh files.
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

/// One caller at a time. A mesh depends on its pulse and those beside it, its bytes on what stands
/// before it since the last key frame: parts that begin with one are as in the whole.
class TakeReconstruction {
 public:
  /// `request` is settled for this take, see settle(). Throws InputError as Reconstructor does.
  TakeReconstruction(const ReconstructRequest& request, int threads, TakeFrames take);
  ~TakeReconstruction();

  /// Appends the meshes of these pulses, rising and behind those of an earlier call, to a file
  /// where they begin a sequence; what is told of them has no `seconds`. Calls `on_frame` behind
  /// each. Throws InputError for bad frames, and std::runtime_error when the disk refuses or an
  /// interrupt came.
  ReconstructReport make(std::span<const int64_t> pulses, PendingMeshFile& file,
                         const std::function<void()>& on_frame);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::ctl
