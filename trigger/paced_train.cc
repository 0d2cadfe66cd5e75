#include "trigger/paced_train.h"

#include <algorithm>
#include <cmath>

#include "base/io/process.h"

namespace v3d::trigger {
namespace {

/// The thread notices stop() within this time.
constexpr Duration kMaxSleep = std::chrono::milliseconds(20);

}  // namespace

PacedTrain::~PacedTrain() {
  stop();
  join();
}

void PacedTrain::plan(const Plan& plan) {
  stop();
  join();
  plan_ = plan;
  const std::lock_guard lock(mutex_);
  reset_counters();
}

void PacedTrain::start() {
  stop();
  join();
  {
    const std::lock_guard lock(mutex_);
    reset_counters();
    stopped_ = false;
  }
  thread_ = std::thread([this, first = clock_.now() + plan_.period / 2] { run(first); });
}

void PacedTrain::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
}

void PacedTrain::reset_counters() {
  commanded_ = skipped_ = 0;
  first_.reset();
  output_failed_ = false;
  lateness_ = Lateness(max_pulse_lateness(plan_.period));
}

void PacedTrain::join() {
  if (thread_.joinable()) thread_.join();
}

void PacedTrain::run(MonotonicInstant first) {
  make_thread_realtime();
  if (!wait_for(first)) return;
  first = std::max(first, clock_.now());
  for (int64_t k = 0;; ++k) {
    const MonotonicInstant at = first + k * plan_.period;
    if (!wait_for(at) || !pulse(k, at)) return;
  }
}

bool PacedTrain::wait_for(MonotonicInstant instant) const {
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopped_) return false;
    }
    const MonotonicInstant now = clock_.now();
    if (now >= instant) return true;
    clock_.sleep_until(std::min(instant, now + kMaxSleep));
  }
}

bool PacedTrain::pulse(int64_t number, MonotonicInstant at) {
  bool in_time = false;
  MonotonicInstant now;
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return false;
    now = clock_.now();
    lateness_.add(now - at);
    in_time = now - at < plan_.skip_after;
    if (!in_time) {
      ++skipped_;
    } else if (!output_.begin_pulse(number, at)) {
      output_failed_ = stopped_ = true;
      return false;
    }
    commanded_ = number + 1;
    if (number == 0) first_ = at;
  }
  if (in_time && plan_.width > Duration::zero() && !end_pulse(now)) return false;
  const std::lock_guard lock(mutex_);
  if (plan_.count && commanded_ == *plan_.count) stopped_ = true;
  return !stopped_;
}

bool PacedTrain::end_pulse(MonotonicInstant began) {
  clock_.sleep_until(began + plan_.width);
  if (output_.end_pulse()) return true;
  const std::lock_guard lock(mutex_);
  output_failed_ = stopped_ = true;
  return false;
}

std::optional<MonotonicInstant> PacedTrain::first_pulse() const {
  const std::lock_guard lock(mutex_);
  return first_;
}

int64_t PacedTrain::commanded() const {
  const std::lock_guard lock(mutex_);
  return commanded_;
}

int64_t PacedTrain::skipped() const {
  const std::lock_guard lock(mutex_);
  return skipped_;
}

bool PacedTrain::finished() const {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

bool PacedTrain::output_failed() const {
  const std::lock_guard lock(mutex_);
  return output_failed_;
}

PulseStatistics PacedTrain::statistics() const {
  const std::lock_guard lock(mutex_);
  return lateness_.statistics();
}

std::string PacedTrain::fault() const {
  const std::lock_guard lock(mutex_);
  if (skipped_ == 0) return {};
  return std::to_string(skipped_) + " pulses skipped: this host was up to " +
         std::to_string(lateness_.max() / std::chrono::milliseconds(1)) + " ms late";
}

void Lateness::add(Duration lateness) {
  lateness = std::max(lateness, Duration::zero());
  const double bucket = kPerOctave * std::log2(static_cast<double>(lateness.count()) + 1);
  ++buckets_[std::min(buckets_.size() - 1, static_cast<size_t>(bucket))];
  ++count_;
  late_count_ += lateness > threshold_ ? 1 : 0;
  max_ = std::max(max_, lateness);
}

Duration Lateness::percentile(double share) const {
  const auto wanted = static_cast<int64_t>(std::ceil(share * static_cast<double>(count_)));
  int64_t passed = 0;
  for (size_t i = 0; i < buckets_.size(); ++i) {
    passed += buckets_[i];
    if (passed < wanted || passed == 0) continue;
    const double end = std::exp2(static_cast<double>(i + 1) / kPerOctave);
    return std::min(max_, Duration(static_cast<int64_t>(end)));
  }
  return {};
}

PulseStatistics Lateness::statistics() const {
  return {.jitter_p50 = percentile(0.5),
          .jitter_p99 = percentile(0.99),
          .jitter_max = max_,
          .late = late_count_};
}

}  // namespace v3d::trigger
