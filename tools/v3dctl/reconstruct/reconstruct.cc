#include "v3dctl/reconstruct/reconstruct.h"

#include "base/time.h"
#include "common/console.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {

ReconstructReport reconstruct_take(const ReconstructRequest& request) {
  const MonotonicInstant begin = Monotonic::now();
  TakeFrames take = open_take(request);
  const std::vector<int64_t> pulses = pulses_of(request, take);
  const int64_t without_frames = pulses_without_frames(request, take);
  const std::filesystem::path place = take.paths().mesh();
  const ReconstructRequest settled = settle(request, take);
  TakeReconstruction reconstruction(settled, threads_of(request), std::move(take));
  PendingMeshFile file(place);
  Progress progress("reconstruct", std::ssize(pulses));
  ReconstructReport report = reconstruction.make(pulses, file, [&] { progress.advance(); });
  file.finish();
  report.incomplete += without_frames;
  report.seconds = to_seconds(Monotonic::now() - begin);
  return report;
}

}  // namespace v3d::ctl
