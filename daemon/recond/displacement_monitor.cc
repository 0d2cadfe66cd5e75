#include "daemon/recond/displacement_monitor.h"

#include <pthread.h>
#include <sched.h>
#include <tbb/task_arena.h>

#include <utility>

#include "base/mask_shape.h"
#include "recon/hull/bounds_mask.h"

namespace v3d {
namespace {

/// Voxels along the longest edge of the space: as fine as an XGA camera sees it from outside.
constexpr double kVoxels = 256;

double voxel_for(const Box& bounds) { return (bounds.max - bounds.min).maxCoeff() / kVoxels; }

/// This thread runs when no other wants the processor. Needs no permission.
void stand_back() {
  const sched_param none{};
  pthread_setschedparam(pthread_self(), SCHED_IDLE, &none);
}

}  // namespace

DisplacementMonitor::DisplacementMonitor(const Rig& rig, const ReconstructOptions& options)
    : rig_(rig),
      hulls_(rig, options.bounds, voxel_for(options.bounds), options.min_views),
      meter_(rig) {
  if (rig_.size() < kMinCameras) return;
  for (const RigCamera& camera : rig_) views_.push_back(bounds_mask(options.bounds, camera.model));
  ended_ = false;
  thread_ = std::thread([this] {
    run();
    ended_ = true;
  });
}

DisplacementMonitor::~DisplacementMonitor() {
  end();
  if (thread_.joinable()) thread_.join();
}

void DisplacementMonitor::end() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_one();
}

void DisplacementMonitor::offer(FrameSet& set) {
  const MonotonicInstant now = Monotonic::now();
  if (!thread_.joinable() || now < next_look_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || busy_ || stopping_) return;
  Masks masks(rig_.size());
  for (Frame& frame : set.frames) {
    const int c = find_camera(rig_, frame.camera);
    if (c >= 0 && frame.mask && frame.mask->size() == rig_[c].model.size()) {
      masks[c] = std::exchange(frame.mask, std::nullopt);
    }
  }
  waiting_ = std::move(masks);
  busy_ = true;
  next_look_ = now + (has_opinion_ ? kPeriod : kFirstPeriod);
  changed_.notify_one();
}

const std::vector<CameraDisplacement>& DisplacementMonitor::result() {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock) told_ = result_;
  return told_;
}

void DisplacementMonitor::run() {
  stand_back();
  tbb::task_arena alone(1);
  for (;;) {
    Masks masks;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || waiting_; });
      if (stopping_) return;
      masks = *std::exchange(waiting_, std::nullopt);
    }
    alone.execute([&] { look(masks); });
  }
}

void DisplacementMonitor::look(const Masks& given) {
  std::vector<Mask> masks(given.size());
  std::vector<const Mask*> all(given.size(), nullptr);
  for (size_t c = 0; c < given.size(); ++c) {
    if (!given[c]) continue;
    masks[c] = both(*given[c], views_[c]);
    all[c] = &masks[c];
  }
  meter_.add(all, hulls_.silhouettes_of_each(all));
  std::vector<CameraDisplacement> found;
  if (meter_.pulses() >= kMinPulses) found = meter_.result(hulls_);
  const std::lock_guard lock(mutex_);
  has_opinion_ = !found.empty();
  result_ = std::move(found);
  busy_ = false;
}

}  // namespace v3d
