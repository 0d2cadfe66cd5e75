// Which pulse the first frame of a train is. The quiet before it says that it is one of the first;
// the camera's counter and the pulses themselves say which.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/core/time.h"
#include "capture/sync/pulse_matcher.h"

namespace v3d {

/// A pulse that was seen on the sense line, or commanded where there is none, by this host's clock.
struct PulseEdge {
  int64_t pulse = 0;
  MonotonicInstant at;
  bool is_timed = true;  ///< else `at` is when it was heard of: another host's clock does not fit
};

/// How long after its pulse a frame arrived.
Duration latency_of(MonotonicInstant received, int64_t pulse, const PulseEdge& edge,
                    Duration period);

/// What is known of the train besides its frames. Anything may be unknown.
struct StartEvidence {
  Duration period{};
  std::optional<PulseEdge> edge{};
  /// One more than that of the last exposure before the quiet.
  std::optional<uint64_t> counter_of_pulse_0{};
  /// Exposures that arrived broken before the first whole frame.
  int64_t broken = 0;
  /// The least that the camera's frames took from their pulses to their arrival in trains before.
  std::optional<Duration> latency{};
};

struct TrainStart {
  size_t strays = 0;     ///< frames at the front that arrived before pulse 0: of no pulse
  int64_t pulse = 0;     ///< of the first frame after them
  bool certain = false;  ///< else all labels of the train may be shifted
};

/// So many frames tell all that frames can.
inline constexpr size_t kStartFrames = 8;

/// `frames`: the first of the train, in order of arrival. Empty while more of them would tell more;
/// never with kStartFrames, or when these are all that there are for now (`no_more`).
///
/// Nothing arrives before its pulse. So frames that came within a period of pulse 0 settle it:
/// the first is of pulse 0, whatever else was lost. Otherwise there are two witnesses: how many
/// exposures the counter says are lost, and what pulse the arrival is of if it took as long as
/// in trains before. Where they agree that nothing is lost it is settled. Where they agree that
/// something is, or the counter says nothing, most of kStartFrames frames have to be as punctual as
/// the earliest. Where they go on to disagree, it is not certain.
///
/// What cannot be known: that the camera missed the first trigger altogether (or in a train without
/// any edge, that a first frame was lost whose counter is not known), while the latency is unknown
/// or an edge is. An edge that was sensed on another host has to be right within a tenth of a
/// period.
std::optional<TrainStart> find_start(std::span<const FrameStamp> frames,
                                     const StartEvidence& evidence, bool no_more);

}  // namespace v3d
