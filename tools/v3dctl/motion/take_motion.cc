#include "v3dctl/motion/take_motion.h"

#include <fmt/core.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "codec/motion_pulse.h"
#include "common/console.h"
#include "recon/render/renderer.h"
#include "v3dctl/motion/motion_file.h"
#include "v3dctl/motion/motion_part.h"

namespace v3d::ctl {

static_assert(codec::MotionLimits::kFileBytes <= io::kMaxTextBytes, "programs read the whole file");

std::unique_ptr<ObservedPulses> open_input(const TrackRequest& request) {
  return request.meshes_only ? open_mesh_folder(request.input, request.height_m, request.frames)
                             : open_take_pulses(request.input, request.frames);
}

recon::TakeSource source_of(ObservedPulses& input) {
  return {[&input](size_t i) { return input.read(i); },
          [&input](size_t i) { return input.read_surface(i); },
          [&input](size_t i, const Mesh& surface) { return input.colours(i, surface); }};
}

recon::OnPulse interruptible(const std::function<void()>& on_pulse) {
  return [&on_pulse](size_t) {
    stop_if_interrupted();
    on_pulse();
  };
}

namespace {

/// The first surface that is not empty, which can be none.
Mesh first_surface(ObservedPulses& input) {
  for (size_t i = 0; i < input.pulses().size(); ++i) {
    Mesh surface = input.read_surface(i)->surface;
    if (!surface.vertices.empty()) return surface;
  }
  return {};
}

}  // namespace

void require_steps(const TrackRequest& request, ObservedPulses& input) {
  const Mesh surface = first_surface(input);
  const double reach = codec::kMaxLattice * request.step_m;
  if (surface.vertices.empty()) return;
  const double half = 0.5 * recon::bounds_of(surface).size().maxCoeff();
  if (half <= reach) return;
  throw InputError(fmt::format(
      "{}: its first surface has an extent of {:.4g} m, but steps of {:.4g} m reach "
      "{:.4g} m; expected a larger --step{}",
      request.input.string(), 2 * half, request.step_m, 2 * reach,
      request.meshes_only ? ", or --height for meshes in other units than metres" : ""));
}

void reject_without_surface(const TrackRequest& request) {
  throw InputError(request.input.string() +
                   ": no pulse has a surface to track; expected other frames, or meshes of the "
                   "space in which the performer is");
}

void write_motion(const TrackRequest& request, const std::string& bytes) {
  if (request.out.empty()) {
    io::throw_if_failed(io::replace_file(take::TakePaths{request.input}.motion(), bytes));
  } else {
    replace_file(request.out, bytes);
  }
}

int tracking_threads(int requested) {
  return requested > 0 ? requested : tbb::info::default_concurrency();
}

namespace {

/// Tracks and encodes in the caller's TBB arena.
TrackReport track_pulses(const TrackRequest& request, ObservedPulses& input,
                         const std::function<void()>& on_pulse, MotionFile& file) {
  recon::TrackedMotion motion = recon::track_motion(source_of(input), input.pulses().size(),
                                                    request.tracking, interruptible(on_pulse));
  if (motion.segments.empty()) reject_without_surface(request);
  for (const recon::TrackedSegment& segment : motion.segments) {
    if (!file.add(encoded_part(segment, request.step_m), [&] { return segment; })) break;
  }
  return file.finish(motion.untracked);
}

}  // namespace

TrackReport track_take(const TrackRequest& request,
                       const std::function<void(int64_t pulses)>& on_begin,
                       const std::function<void()>& on_pulse) {
  const MonotonicInstant began = Monotonic::now();
  const std::unique_ptr<ObservedPulses> input = open_input(request);
  on_begin(std::ssize(input->pulses()));
  const int threads = tracking_threads(request.threads);
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism,
                                    static_cast<size_t>(threads));
  tbb::task_arena arena(threads);
  MotionFile file(request, input->pulses());
  TrackReport report = arena.execute([&] {
    require_steps(request, *input);
    return track_pulses(request, *input, on_pulse, file);
  });
  report.is_unfinished = input->is_unfinished();
  report.read_errors = input->read_errors();
  write_motion(request, file.bytes());
  report.peak_rss_mb = peak_rss_mb();
  report.seconds = to_seconds(Monotonic::now() - began);
  return report;
}

}  // namespace v3d::ctl
