// Times of sensed pulses, start of a train.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>

#include "base/core/time.h"
#include "capture/sync/pulse_matcher.h"

namespace v3d::capture {

// Times of the sensed pulses of a train. They label the frames of free-running cameras.

/// The pulse nearest to an exposure.
struct NearestPulse {
  std::optional<int64_t> pulse = {};  ///< empty: the exposure is before or after the train
  /// From the pulse to the exposure; may be negative. Before and after the train: from the pulse
  /// that a longer train would have. Empty if no pulse was sensed.
  std::optional<Duration> phase = {};
};

/// The latest 256 sensed pulses of a train, with times of this host's clock. Thread-safe.
class PulseTimes {
 public:
  /// Maximum time from a pulse to the call of add().
  static constexpr Duration kMaxSenseDelay = std::chrono::milliseconds(250);

  explicit PulseTimes(Duration period) : period_(period) {}

  /// Starts a train of this period and drops the pulses of the previous one.
  void begin(Duration period);
  /// Ends the train: no further pulse follows.
  void end();
  /// Adds a sensed pulse. Ignores it if its number or its time is not later than the last one's.
  void add(int64_t pulse, MonotonicInstant at);

  /// Period of the current or last train.
  Duration period() const;
  /// Number of trains started so far.
  int64_t trains() const;

  /// The pulse nearest to `at`, if one lies within half a period.
  ///
  /// Pulses lie on a regular grid, of which the times of neighbouring pulses give the median. So a
  /// single pulse that a busy host sent late does not change the pulses of frames.
  ///
  /// `before` is the phase of the previous frame of the camera. It gives hysteresis: a frame keeps
  /// the pulse next to that of the previous frame until it is 0.6 periods away from it. So frames
  /// half-way between two pulses do not alternate, from the last frame before the train on. A pulse
  /// that was not sensed, between two sensed ones, counts as well. Empty while a pulse that is
  /// reported later may change the result.
  std::optional<NearestPulse> find(MonotonicInstant at, std::optional<Duration> before,
                                   MonotonicInstant now) const;

 private:
  struct Pulse {
    int64_t number = 0;
    MonotonicInstant at;
  };
  using Pulses = std::deque<Pulse>;
  Pulses::const_iterator nearest_to(MonotonicInstant at) const;
  MonotonicInstant regular_time(Pulses::const_iterator pulse) const;

  mutable std::mutex mutex_;  ///< protects everything below
  Duration period_;
  bool running_ = false;
  int64_t trains_ = 0;
  Pulses pulses_;  ///< the latest ones, in order
};

// Finds the pulse of the first frame of a train by the camera's counter and the times of pulses.

/// A pulse that was sensed, or commanded if there is no sense line. Time of this host's clock.
struct PulseEdge {
  int64_t pulse = 0;
  MonotonicInstant at;
  bool is_timed = true;  ///< false: the time is unknown, and `at` must not be used
  /// `at` is the time of the command that started the train. An instrument makes pulse 0 up to tens
  /// of milliseconds later, after another delay in each train.
  bool may_be_early = false;
};

/// Time from a pulse to the arrival of its frame. `edge` is any pulse of the train.
Duration latency_of(MonotonicInstant received, int64_t pulse, const PulseEdge& edge,
                    Duration period);

/// Data about the train besides its frames. Optional fields may be unknown.
struct StartEvidence {
  Duration period{};
  std::optional<PulseEdge> edge{};
  /// Counter of the last exposure before the silent interval, plus 1.
  std::optional<uint64_t> counter_of_pulse_0{};
  /// Counter of the first exposure, if the camera has sent no frame since it was opened and starts
  /// to count at a known value (Camera::first_counter()).
  std::optional<uint64_t> first_counter{};
  /// Number of damaged frames before the first complete one.
  int64_t damaged = 0;
  /// Minimum time from a pulse to the arrival of its frame in previous trains of this camera.
  std::optional<Duration> latency{};
};

struct TrainStart {
  size_t strays = 0;     ///< frames at the front that arrived before pulse 0 and belong to no pulse
  int64_t pulse = 0;     ///< of the first frame after them
  bool certain = false;  ///< false: all labels of the train may be shifted
};

/// Maximum number of frames that find_start() needs, if the host did not stall.
inline constexpr size_t kStartFrames = 8;
/// Maximum number of frames that it needs while this host catches up after a stall: it reads the
/// frames faster than they are exposed, so a later one is on time.
inline constexpr size_t kMaxStartFrames = 24;

/// Finds the pulse of the first frame of a train.
///
/// `frames` are the first frames of the train, in order of arrival. Returns empty while further
/// frames would help. It never does so with kMaxStartFrames frames, with kStartFrames that show no
/// stall, or with `no_more`: these are all frames for now.
///
/// No frame arrives before its pulse. So if a frame arrived less than a period after pulse 0, the
/// first frame is of pulse 0, whatever was lost. Otherwise two sources give the pulse:
///   - the counter: the number of lost exposures;
///   - the arrival, if the latency is that of previous trains.
/// If both agree that nothing was lost, the result is certain. If both agree that frames were lost,
/// or the counter is unknown, most of kStartFrames frames must be as early as the earliest. If the
/// sources disagree, the result is not certain. If the time of no pulse is known, the counter alone
/// gives the pulse, and the result is certain only if the device times of the frames agree with it.
/// If latency and counter_of_pulse_0 are unknown, first_counter shows that no exposure was lost. If
/// no pulse time is known, it also shows that some were.
/// If the time of pulse 0 may be early, the counter alone gives the pulse, too, and the result is
/// certain only if nothing was lost.
///
/// Frames that arrived before pulse 0 are strays. But if the last of them was exposed one to three
/// periods before the next frame, they are frames of the train, and the times of pulses are late.
/// Then the result is not certain.
///
/// Limits: a missed first trigger is not detected if the latency is unknown, no pulse time is known
/// or it may be early. Without a pulse time and a counter, a lost first frame is not detected
/// either. The time of a pulse that another host sensed may be late by at most 0.1 periods more
/// than the latency. If more, only a frame that seems to be a stray shows it.
std::optional<TrainStart> find_start(std::span<const FrameStamp> frames,
                                     const StartEvidence& evidence, bool no_more);

}  // namespace v3d::capture
