#include "daemon/recond/displacement_monitor.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"

namespace v3d::recond {
namespace {

/// How often a paused thread checks whether it may continue.
constexpr Duration kPollPeriod = std::chrono::milliseconds(5);

/// Sets the scheduling policy of a thread. False when the process may not.
///
/// SCHED_IDLE needs no permission, except under the filter of v3d-recond@.service. A higher
/// priority costs live meshes: with nice 15 all the time, tools/demo on two cores kept 25 pulses a
/// second in 1 of 4 runs, with SCHED_IDLE in 3 of 3.
bool set_policy(pthread_t thread, int policy) {
  const sched_param none{};
  return pthread_setschedparam(thread, policy, &none) == 0;
}

}  // namespace

DisplacementMonitor::DisplacementMonitor(const Rig& rig, const recon::ReconstructOptions& options,
                                         Duration starved_after)
    : rig_(rig),
      starved_after_(starved_after),
      hulls_(rig, options.bounds, recon::voxel_for_silhouettes(rig, options.bounds),
             options.min_views),
      meter_(rig) {
  if (rig_.size() < kMinCameras) return;
  for (const RigCamera& camera : rig_)
    views_.push_back(recon::bounds_mask(options.bounds, camera.model));
  hulls_.set_pause([this] { pause_while_reconstructing(); });
  stopped_ = false;
  thread_ = std::thread([this] {
    run();
    stopped_ = true;
  });
}

DisplacementMonitor::~DisplacementMonitor() {
  stop();
  if (thread_.joinable()) thread_.join();
}

void DisplacementMonitor::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_one();
}

void DisplacementMonitor::offer(recon::FrameSet& set) {
  const MonotonicInstant now = Monotonic::now();
  if (!thread_.joinable() || now < next_sample_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || stopping_) return;
  if (busy_) {
    raise_priority_if_starved(now);
    return;
  }
  Masks masks(rig_.size());
  for (Frame& frame : set.frames) {
    const int c = find_camera(rig_, frame.camera);
    if (c >= 0 && frame.mask && frame.mask->size() == rig_[c].model.size()) {
      masks[c] = std::exchange(frame.mask, std::nullopt);
    }
  }
  waiting_ = std::move(masks);
  busy_ = true;
  busy_since_ = now;
  next_sample_ = now + (has_result_ ? kPeriod : kFirstPeriod);
  changed_.notify_one();
}

const std::vector<recon::CameraDisplacement>& DisplacementMonitor::result() {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock) returned_ = result_;
  return returned_;
}

void DisplacementMonitor::raise_priority_if_starved(MonotonicInstant now) {
  if (!may_idle_ || raised_ || now - busy_since_ < starved_after_) return;
  raised_ = set_policy(thread_.native_handle(), SCHED_OTHER);
}

/// Without idle priority: called by the thread before each hull, some milliseconds of work.
void DisplacementMonitor::pause_while_reconstructing() {
  if (may_idle_) return;
  const MonotonicInstant begin = Monotonic::now();
  std::unique_lock lock(mutex_);
  const MonotonicInstant latest =
      std::max(busy_since_ + starved_after_, begin + kRestPerWork * (begin - resumed_));
  while (!stopping_ && sets_in_progress_ > 0 && Monotonic::now() < latest) {
    paused_ = true;
    changed_.wait_for(lock, kPollPeriod);
  }
  paused_ = false;
  resumed_ = Monotonic::now();
}

void DisplacementMonitor::run() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kStarvedNice);  // has no effect while idle
  {
    const bool may_idle = set_policy(pthread_self(), SCHED_IDLE);
    const std::lock_guard lock(mutex_);
    may_idle_ = may_idle;
  }
  tbb::task_arena one_thread(1);
  for (;;) {
    Masks masks;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || waiting_; });
      if (stopping_) return;
      masks = *std::exchange(waiting_, std::nullopt);
    }
    one_thread.execute([&] { measure(masks); });
  }
}

void DisplacementMonitor::measure(const Masks& sample) {
  resumed_ = Monotonic::now();
  std::vector<Mask> masks(sample.size());
  std::vector<const Mask*> all(sample.size(), nullptr);
  for (size_t c = 0; c < sample.size(); ++c) {
    if (!sample[c]) continue;
    masks[c] = intersection_of(*sample[c], views_[c]);
    all[c] = &masks[c];
  }
  meter_.add(all, hulls_.silhouettes_of_each(all));
  std::vector<recon::CameraDisplacement> found;
  if (meter_.pulses() >= kMinPulses) found = meter_.result(hulls_);
  const std::lock_guard lock(mutex_);
  has_result_ = !found.empty();
  result_ = std::move(found);
  busy_ = false;
  if (raised_ && has_result_) raised_ = !set_policy(pthread_self(), SCHED_IDLE);
}

}  // namespace v3d::recond
