// Timecode output of the trigger's node, and the time of day as timecode.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <ctime>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "capture/sync/pulse_times.h"
#include "sound/sound_device.h"
#include "sound/timecode_clock.h"

namespace v3d::captured {

// Local time of day of instants of the monotonic clock, also as timecode.

/// The same instant by the realtime clock, from the current difference of the clocks.
inline RealtimeInstant to_realtime(MonotonicInstant at) {
  return Realtime::now() - (Monotonic::now() - at);
}

/// Seconds since midnight in the time zone of this process.
inline double seconds_of_day(MonotonicInstant at) {
  const int64_t ns = to_ns(to_realtime(at));
  const auto seconds = static_cast<time_t>(ns / 1'000'000'000);
  tm local{};
  localtime_r(&seconds, &local);
  return (local.tm_hour * 60.0 + local.tm_min) * 60 + local.tm_sec +
         static_cast<double>(ns % 1'000'000'000) * 1e-9;
}

/// The timecode of the time of day, from `at` on.
inline sound::TimecodeClock day_clock(sound::TimecodeRate rate, MonotonicInstant at) {
  return {rate, seconds_of_day(at) * sound::frames_per_second(rate), at};
}

// Timecode output of the trigger's node.

using OpenSoundOutput = std::function<io::Result<std::unique_ptr<sound::SoundOutput>>(
    const StudioTimecodeOutput& output)>;

/// Plays longitudinal timecode on a sound device, in step with the pulses (sound/timecode_clock.h),
/// in a thread of its own. After an error, and when no sample was played for two seconds, the
/// device is opened again every second; the timecode counts on. Any thread may call the functions;
/// none waits for the device.
class TimecodeOutput {
 public:
  /// The timecode starts now, at the time of day or at StudioTimecodeOutput::start.
  explicit TimecodeOutput(const StudioTimecodeOutput& output,
                          OpenSoundOutput open = sound::open_sound_output);
  ~TimecodeOutput();
  TimecodeOutput(const TimecodeOutput&) = delete;
  TimecodeOutput& operator=(const TimecodeOutput&) = delete;

  /// The next pulse is the first of a train of this rate.
  void begin_train(double pulse_rate_hz);
  void pulse_at(const capture::PulseEdge& edge);

  struct Status {
    bool is_open = false;
    std::string fault;      ///< of the device, one line; empty: none
    int64_t underruns = 0;  ///< since begin_train(), before the first one since the start
  };
  Status status() const;
  /// The state of the clock now.
  sound::TimecodeClock clock() const;

 private:
  void run();
  void play(sound::SoundOutput& device);
  void set_fault(const std::string& fault);
  /// False when the thread has to end.
  bool wait(Duration duration);

  const StudioTimecodeOutput output_;
  const OpenSoundOutput open_;
  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  bool stopping_ = false;
  Status status_;
  sound::TimecodeClock clock_;
  std::thread thread_;  ///< last member
};

}  // namespace v3d::captured
