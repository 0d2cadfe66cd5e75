#include "daemon/captured/timecode_output.h"

#include <algorithm>
#include <utility>

#include "sound/timecode_clock.h"

namespace v3d::captured {
namespace {

constexpr Duration kWaitTimeout = std::chrono::milliseconds(200);
constexpr Duration kReopenAfter = std::chrono::seconds(1);
/// Interval of the blocks, and of the polls of a device without space.
constexpr Duration kBlock = std::chrono::milliseconds(10);

/// A device that has played no sample for this long, in so many waits, has failed. The waits count,
/// too: a process that was stopped has time pass without one.
constexpr Duration kMaxStall = std::chrono::seconds(2);
constexpr int kMaxIdleWaits = kMaxStall / kWaitTimeout;

/// Whether a device plays on.
class ProgressMonitor {
 public:
  /// False when the device has stopped.
  bool add(int64_t played) {
    const MonotonicInstant now = Monotonic::now();
    if (played_ != played) {
      played_ = played;
      moved_ = now;
      idle_waits_ = 0;
      return true;
    }
    return ++idle_waits_ < kMaxIdleWaits || now - moved_ < kMaxStall;
  }

 private:
  int64_t played_ = -1;
  MonotonicInstant moved_{};
  int idle_waits_ = 0;
};

/// The studio file has a valid rate and start.
sound::TimecodeClock clock_of(const StudioTimecodeOutput& output) {
  const auto rate =
      sound::timecode_rate_from_name(output.timecode_rate).value_or(sound::TimecodeRate::k25);
  const MonotonicInstant now = Monotonic::now();
  const auto start = sound::parse_timecode(output.start, rate);
  if (!start) return day_clock(rate, now);
  return {rate, static_cast<double>(sound::frame_number(*start, rate)), now};
}

}  // namespace

TimecodeOutput::TimecodeOutput(const StudioTimecodeOutput& output, OpenSoundOutput open)
    : output_(output),
      open_(std::move(open)),
      clock_(clock_of(output)),
      thread_([this] { run(); }) {}

TimecodeOutput::~TimecodeOutput() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void TimecodeOutput::begin_train(double pulse_rate_hz) {
  const std::lock_guard lock(mutex_);
  clock_.begin_train(pulse_rate_hz);
  status_.underruns = 0;
}

void TimecodeOutput::pulse_at(const capture::PulseEdge& edge) {
  const std::lock_guard lock(mutex_);
  clock_.add_pulse(edge.pulse, edge.at);
}

TimecodeOutput::Status TimecodeOutput::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

sound::TimecodeClock TimecodeOutput::clock() const {
  const std::lock_guard lock(mutex_);
  return clock_;
}

void TimecodeOutput::run() {
  do {
    auto device = open_(output_);
    if (device) {
      set_fault("");
      play(**device);
    } else {
      set_fault(device.error().message);
    }
  } while (wait(kReopenAfter));
}

/// Plays until an error, or until the thread has to end.
void TimecodeOutput::play(sound::SoundOutput& device) {
  sound::LtcPlayer player(output_.rate_hz, clock().rate());
  const auto block = static_cast<int64_t>(to_seconds(kBlock) * output_.rate_hz);
  int64_t underruns = 0;
  ProgressMonitor progress;
  while (wait(Duration(0))) {
    const auto played = device.wait(kWaitTimeout);
    if (!played) return set_fault(played.error().message);
    if (!progress.add(played->played)) {
      return set_fault(output_.device + " plays no samples, and reports no error");
    }
    if (played->underruns != underruns) {
      const std::lock_guard lock(mutex_);
      status_.underruns += played->underruns - underruns;
      underruns = played->underruns;
      player.add_underrun();
    } else {
      player.add_stamp(played->played, played->at);
    }
    if (played->space < block) {
      wait(kBlock);
      continue;
    }
    if (const auto done = device.write(player.next(block, clock())); !done) {
      return set_fault(done.error().message);
    }
  }
}

void TimecodeOutput::set_fault(const std::string& fault) {
  const std::lock_guard lock(mutex_);
  status_.fault = fault;
  status_.is_open = fault.empty();
}

bool TimecodeOutput::wait(Duration duration) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, duration, [&] { return stopping_; });
  return !stopping_;
}

}  // namespace v3d::captured
