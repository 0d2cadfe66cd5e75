// PulseMapper: finds the sample of every pulse of a take while sound is recorded.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "sound/clock_filter.h"
#include "sound/pulse_map.h"

namespace v3d::sound {

/// What a map of pulses was made from.
enum class MapSource : uint8_t {
  kNone,          ///< no map: no pulse, or no sound
  kPulseChannel,  ///< edges of the trigger pulse in a channel of the sound
  kTimeStamps,    ///< the host's time stamps of pulses and of blocks of sound
};
/// "none", "pulse channel", "time stamps"
std::string_view name(MapSource source);

struct MappedPulses {
  MapSource source = MapSource::kNone;
  PulseMap map;
  double uncertainty_s = 0;  ///< one standard deviation of a position, and the tolerance of the map
  /// Drift of the sample clock, 1e-6, positive where it is fast: against the pulses for a pulse
  /// channel, against the host's clock for time stamps.
  double drift_ppm = 0;
  int64_t edges = 0;          ///< edges that belong to a pulse
  int64_t missing_edges = 0;  ///< pulses without an edge
  int64_t extra_edges = 0;    ///< edges without a pulse
};

/// Maps pulses to samples in two steps. The time stamps of pulses and of sound blocks give each
/// pulse a position to about a millisecond (SampleClock). This finds the edge of the pulse in the
/// pulse channel, if there is one; a second filter follows the edges, rejects those that do not
/// belong to the train and bridges lost ones. Without such a channel, or without edges in it, the
/// first positions are the map.
///
/// The difference of the two positions, as the latency of a sound device, must be less than 0.45
/// periods of the pulses. Memory is bounded: kMaxWaiting pulses and as many edges wait for each
/// other. One thread.
class PulseMapper {
 public:
  static constexpr size_t kMaxWaiting = 4096;

  struct Setup {
    int rate_hz = 48'000;
    double pulse_rate_hz = 25;
    bool has_pulse_channel = false;
    /// Uncertainty of the time stamps of blocks that does not show in their jitter: latency, s.
    double stamp_uncertainty_s = 1e-3;
    double tolerance_s = 50e-6;  ///< of the map
  };
  explicit PulseMapper(const Setup& setup);

  /// The device had recorded `samples` samples at `at`.
  void add_stamp(int64_t samples, MonotonicInstant at);
  /// `length` samples from `sample` on were lost; the file has silence there. `deviation`: standard
  /// deviation of the error of `length`. Call before the next add_stamp().
  void add_gap(int64_t sample, int64_t length, Duration deviation);
  /// A pulse of the train and its time on the host's clock. Numbers ascend.
  void add_pulse(int64_t pulse, MonotonicInstant at);
  /// The edges in the pulse channel, ascending; all before `searched` are known.
  void add_edges(std::span<const double> edges, double searched);

  /// Maps the pulses that still wait. No call of another function but result() may follow.
  void finish();
  /// The result so far.
  MappedPulses result() const;

 private:
  struct Pulse {
    int64_t number = 0;
    double coarse = 0;  ///< position by time stamps, samples
  };
  struct Gap {
    double begin = 0, end = 0;  ///< samples
  };
  struct Expected {
    double sample = 0;
    double gate = 0;  ///< samples
  };

  void place_pulses(MonotonicInstant until);
  void match(double searched);
  bool acquire(double searched);
  Expected expected(const Pulse& pulse) const;
  void apply_gaps(double sample);
  std::optional<double> take_edge(const Expected& expected);
  double nearest_edge(double sample) const;
  void track(const Pulse& pulse, std::optional<double> edge);
  void miss(const Pulse& pulse);
  void add_coarse_points();
  void extend(PulseMap& map, double slope) const;
  double train_seconds(const Pulse& pulse) const {
    return static_cast<double>(pulse.number) / setup_.pulse_rate_hz;
  }
  double samples_per_pulse() const;

  const Setup setup_;
  const double period_;  ///< of the pulses, samples
  SampleClock clock_;
  PulseMapBuilder coarse_map_;
  std::optional<int64_t> first_pulse_;
  int64_t last_pulse_ = 0;
  std::deque<std::pair<int64_t, MonotonicInstant>> unplaced_;  ///< pulses later than the last stamp
  std::deque<Pulse> pulses_;                                   ///< wait for their edges
  std::deque<double> edges_;
  std::deque<Gap> gaps_;  ///< not reached by the pulses yet
  ClockFilter train_;     ///< samples of edges against time of the train
  bool is_tracking_ = false;
  int missed_ = 0;  ///< consecutive pulses without an edge
  bool has_edge_since_gap_ = false;
  std::vector<PulseMap::Knot> without_edges_;  ///< coarse, at most two, since the last gap
  double lag_ = 0;                             ///< of edges behind coarse positions, samples
  PulseMapBuilder edge_map_;
  int64_t matched_ = 0, missing_ = 0, extra_ = 0;
};

}  // namespace v3d::sound
