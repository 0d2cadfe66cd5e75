#include "capture/sync/pulse_times.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace v3d::capture {
namespace {

constexpr size_t kMaxPulses = 256;
/// Number of pulses on each side of one that give its regular time.
constexpr ptrdiff_t kNeighbours = 4;

int64_t whole_periods(Duration d, Duration period) {
  return std::llround(static_cast<double>(d.count()) / static_cast<double>(period.count()));
}

}  // namespace

void PulseTimes::begin(Duration period) {
  const std::lock_guard lock(mutex_);
  period_ = period;
  running_ = true;
  ++trains_;
  pulses_.clear();
}

void PulseTimes::end() {
  const std::lock_guard lock(mutex_);
  running_ = false;
}

void PulseTimes::add(int64_t pulse, MonotonicInstant at) {
  const std::lock_guard lock(mutex_);
  if (!pulses_.empty() && (pulse <= pulses_.back().number || at <= pulses_.back().at)) return;
  pulses_.push_back({pulse, at});
  if (pulses_.size() > kMaxPulses) pulses_.pop_front();
}

int64_t PulseTimes::trains() const {
  const std::lock_guard lock(mutex_);
  return trains_;
}

Duration PulseTimes::period() const {
  const std::lock_guard lock(mutex_);
  return period_;
}

PulseTimes::Pulses::const_iterator PulseTimes::nearest_to(MonotonicInstant at) const {
  const auto after = std::upper_bound(pulses_.begin(), pulses_.end(), at,
                                      [](MonotonicInstant t, const Pulse& p) { return t < p.at; });
  if (after == pulses_.begin()) return after;
  const auto before = std::prev(after);
  if (after == pulses_.end()) return before;
  return at - before->at <= after->at - at ? before : after;
}

/// The time of a pulse by its neighbours and itself: the lower median, because pulses are late and
/// never early.
MonotonicInstant PulseTimes::regular_time(Pulses::const_iterator pulse) const {
  const auto begin = pulse - std::min<ptrdiff_t>(pulse - pulses_.begin(), kNeighbours);
  const auto end = pulse + std::min<ptrdiff_t>(pulses_.end() - pulse, kNeighbours + 1);
  std::array<MonotonicInstant, 2 * kNeighbours + 1> times;
  const auto used = std::transform(begin, end, times.begin(), [&](const Pulse& p) {
    return p.at + (pulse->number - p.number) * period_;
  });
  const auto median = times.begin() + (used - times.begin() - 1) / 2;
  std::nth_element(times.begin(), median, used);
  return *median;
}

std::optional<NearestPulse> PulseTimes::find(MonotonicInstant at, std::optional<Duration> before,
                                             MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  if (!running_) return NearestPulse{};
  const bool all_known = now - at > period_ / 2 + kMaxSenseDelay;
  if (pulses_.empty()) return all_known ? std::optional(NearestPulse{}) : std::nullopt;

  const auto nearest = nearest_to(at);
  Duration phase = at - regular_time(nearest);
  int64_t periods = whole_periods(phase, period_);
  phase -= periods * period_;
  const int64_t shift = before ? whole_periods(phase - *before, period_) : 0;
  const bool keeps_phase =
      before && std::abs((phase - shift * period_).count()) <= period_.count() * 6 / 10;
  if (keeps_phase) {
    periods += shift;
    phase -= shift * period_;
  }
  const Pulse& last = pulses_.back();
  const int64_t pulse = nearest->number + periods;
  const bool certain = last.at > at || keeps_phase || phase < period_ * 4 / 10;
  if (!all_known && (pulse > last.number || !certain)) return std::nullopt;
  const bool in_train = pulse >= 0 && pulse <= last.number;
  return NearestPulse{.pulse = in_train ? std::optional(pulse) : std::nullopt, .phase = phase};
}

namespace {

/// Maximum number of exposures lost before the first frame. Larger counter differences are invalid.
constexpr int64_t kMaxLost = 1000;
constexpr double kEdgeError = 0.1;        ///< periods
constexpr double kMaxArrivalDelay = 0.4;  ///< periods; delay of a frame that counts as on time
/// Periods. With a longer arrival of the first frame, the camera more probably missed triggers.
constexpr int64_t kMaxUnknownLatency = 2;
constexpr double kMaxStepDeviation = 0.2;  ///< periods between two frames of a train
constexpr int64_t kMaxStepsFromStray = 3;  ///< periods; frames between them may be lost

double periods(Duration duration, Duration period) {
  return static_cast<double>(duration.count()) / static_cast<double>(period.count());
}

/// Whether the frames arrived in less time than they were exposed: the host stalled before, and
/// later frames are less late.
bool is_catching_up(std::span<const FrameStamp> frames, Duration period) {
  const Duration exposed = frames.back().exposed - frames.front().exposed;
  const Duration received = frames.back().received - frames.front().received;
  return periods(exposed - received, period) > kMaxArrivalDelay;
}

bool is_before_pulse_0(const FrameStamp& frame, const StartEvidence& e) {
  return periods(latency_of(frame.received, 0, *e.edge, e.period), e.period) <= -kEdgeError;
}

/// Whether `frame` was exposed so many whole periods after `before` that both seem to be of pulses.
bool is_in_step(const FrameStamp& before, const FrameStamp& frame, Duration period) {
  const double passed = periods(frame.exposed - before.exposed, period);
  const int64_t steps = std::llround(passed);
  return steps >= 1 && steps <= kMaxStepsFromStray &&
         std::abs(passed - static_cast<double>(steps)) <= kMaxStepDeviation;
}

/// Number of frames at the front that arrived before pulse 0 and are no frames of the train.
size_t count_strays(std::span<const FrameStamp> frames, const StartEvidence& e) {
  size_t count = 0;
  while (count < frames.size() && is_before_pulse_0(frames[count], e)) ++count;
  if (count == frames.size()) return count;
  while (count > 0 && is_in_step(frames[count - 1], frames[count], e.period)) --count;
  return count;
}

/// Arrival of the first frame in periods after pulse 0, estimated from several frames.
struct Arrivals {
  double earliest = kMaxLost;  ///< by the frame with the smallest delay
  bool steady = false;         ///< most frames had as small a delay, so the host did not stall
};

Arrivals arrivals_of(std::span<const FrameStamp> frames, const StartEvidence& e) {
  PulseMatcher numbers(e.period);  // counted from the first frame
  std::vector<double> all;
  for (const FrameStamp& frame : frames) {
    const PulseMatch match = numbers.label(frame);
    if (match.suspect) continue;
    all.push_back(periods(latency_of(frame.received, match.pulse, *e.edge, e.period), e.period));
  }
  const double earliest = *std::ranges::min_element(all);
  const auto on_time_frames = std::ranges::count_if(
      all, [&](double arrival) { return arrival - earliest < kMaxArrivalDelay; });
  return {.earliest = earliest, .steady = static_cast<size_t>(on_time_frames) > kStartFrames / 2};
}

/// Number of exposures from one value of the counter to another. Empty if it is not plausible.
std::optional<int64_t> exposures_between(uint64_t from, uint64_t to) {
  const auto count = static_cast<int64_t>(to - from);
  return count >= 0 && count <= kMaxLost ? std::optional(count) : std::nullopt;
}

/// Number of exposures without a frame since the camera was opened. Empty if it is not known.
std::optional<int64_t> lost_since_opened(const FrameStamp& first, size_t strays,
                                         const StartEvidence& e) {
  if (!e.first_counter) return std::nullopt;
  return exposures_between(*e.first_counter + strays, first.counter);
}

/// The pulse of the first frame by the counter. Empty if the counter gives none.
std::optional<int64_t> by_counter(const FrameStamp& first, size_t strays, const StartEvidence& e) {
  if (e.counter_of_pulse_0) {
    return exposures_between(*e.counter_of_pulse_0 + strays, first.counter);
  }
  const auto lost = lost_since_opened(first, strays, e);
  const bool others_are_lost = lost && *lost != e.damaged;
  return e.damaged > 0 && !others_are_lost ? std::optional(e.damaged) : std::nullopt;
}

/// Whether as many periods as exposures lie between the first and the last frame. If not, the first
/// frame may have been exposed long before pulse 0.
bool counter_agrees_with_times(std::span<const FrameStamp> frames, const StartEvidence& e) {
  const FrameStamp &first = frames.front(), &last = frames.back();
  const double passed = periods(last.exposed - first.exposed, e.period);
  return std::abs(passed - static_cast<double>(last.counter - first.counter)) < 0.5;
}

/// Result if the time of no pulse is known.
TrainStart start_by_counter(std::span<const FrameStamp> frames, const StartEvidence& e) {
  auto counted = by_counter(frames.front(), 0, e);
  if (!counted) counted = lost_since_opened(frames.front(), 0, e);
  const bool certain = counted ? *counted == e.damaged : !e.counter_of_pulse_0;
  return {.pulse = counted.value_or(0), .certain = certain && counter_agrees_with_times(frames, e)};
}

}  // namespace

Duration latency_of(MonotonicInstant received, int64_t pulse, const PulseEdge& edge,
                    Duration period) {
  return received - (edge.at + (pulse - edge.pulse) * period);
}

std::optional<TrainStart> find_start(std::span<const FrameStamp> frames, const StartEvidence& e,
                                     bool no_more) {
  bool all = no_more || frames.size() >= kStartFrames;
  if (!e.edge) return all ? std::optional(start_by_counter(frames, e)) : std::nullopt;
  if (!no_more && frames.size() < kMaxStartFrames && is_catching_up(frames, e.period)) all = false;
  const size_t strays = count_strays(frames, e);
  const auto result = [&](int64_t pulse, bool certain) {
    return TrainStart{.strays = strays, .pulse = pulse, .certain = certain};
  };
  frames = frames.subspan(strays);
  const bool pulses_seem_late = frames.empty() || is_before_pulse_0(frames.front(), e);
  if (pulses_seem_late) return all ? std::optional(result(0, false)) : std::nullopt;

  const auto counted = by_counter(frames.front(), strays, e);
  const Arrivals arrivals = arrivals_of(frames, e);
  const auto latest = static_cast<int64_t>(std::floor(arrivals.earliest + kEdgeError));
  if (latest <= 0) return result(0, true);
  if (!e.latency || e.edge->may_be_early) {
    if (counted == e.damaged && *counted <= latest) return result(*counted, true);
    const bool is_plausible = e.damaged <= latest && latest - e.damaged <= kMaxUnknownLatency;
    if (is_plausible && lost_since_opened(frames.front(), strays, e) == e.damaged) {
      return result(e.damaged, true);
    }
    if (!all) return std::nullopt;
    return result(std::min(counted.value_or(latest), latest), false);
  }
  const double arrived = arrivals.earliest - periods(*e.latency, e.period);
  const int64_t pulse = std::clamp<int64_t>(std::llround(arrived), 0, latest);
  const bool on_time = std::abs(arrived - static_cast<double>(pulse)) < kMaxArrivalDelay;
  if (on_time && counted == pulse && pulse == e.damaged) return result(pulse, true);
  if (!all) return std::nullopt;
  const bool confirmed = on_time && arrivals.steady && counted.value_or(pulse) == pulse;
  return result(std::min(pulse, counted.value_or(pulse)), confirmed);
}

}  // namespace v3d::capture
