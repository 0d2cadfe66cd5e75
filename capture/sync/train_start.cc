#include "capture/sync/train_start.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace v3d {
namespace {

constexpr int64_t kMaxLost = 1000;          ///< more exposures lost before the first frame are a
                                            ///< counter that means something else
constexpr double kEdgeError = 0.1;          ///< periods
constexpr double kLargestHesitation = 0.4;  ///< periods, of the earliest of several frames

double periods(Duration duration, Duration period) {
  return static_cast<double>(duration.count()) / static_cast<double>(period.count());
}

/// So many frames arrived before pulse 0.
size_t count_strays(std::span<const FrameStamp> frames, const StartEvidence& e) {
  const auto of_the_train = std::ranges::find_if(frames, [&](const FrameStamp& frame) {
    return periods(latency_of(frame.received, 0, *e.edge, e.period), e.period) > -kEdgeError;
  });
  return static_cast<size_t>(of_the_train - frames.begin());
}

/// When the frames arrived, each as if it were the first: in periods after pulse 0.
struct Arrivals {
  double earliest = kMaxLost;  ///< of the frame that hesitated least
  bool steady = false;         ///< most came as punctually: the host did not stand still
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
  const auto punctual = std::ranges::count_if(
      all, [&](double arrival) { return arrival - earliest < kLargestHesitation; });
  return {.earliest = earliest, .steady = static_cast<size_t>(punctual) > kStartFrames / 2};
}

/// The pulse of the first frame; empty when there is no saying.
std::optional<int64_t> by_counter(const FrameStamp& first, size_t strays, const StartEvidence& e) {
  if (!e.counter_of_pulse_0) return e.broken > 0 ? std::optional(e.broken) : std::nullopt;
  const auto lost = static_cast<int64_t>(first.counter - *e.counter_of_pulse_0 - strays);
  return lost >= 0 && lost <= kMaxLost ? std::optional(lost) : std::nullopt;
}

/// No edge is known.
TrainStart trust_counter(const FrameStamp& first, const StartEvidence& e) {
  const auto counted = by_counter(first, 0, e);
  const bool certain = counted ? *counted == e.broken : !e.counter_of_pulse_0;
  return {.pulse = counted.value_or(0), .certain = certain};
}

}  // namespace

Duration latency_of(MonotonicInstant received, int64_t pulse, const PulseEdge& edge,
                    Duration period) {
  return received - (edge.at + (pulse - edge.pulse) * period);
}

std::optional<TrainStart> find_start(std::span<const FrameStamp> frames, const StartEvidence& e,
                                     bool no_more) {
  const bool all = no_more || frames.size() >= kStartFrames;
  if (!e.edge) return all ? std::optional(trust_counter(frames.front(), e)) : std::nullopt;
  const size_t strays = count_strays(frames, e);
  const auto verdict = [&](int64_t pulse, bool certain) {
    return TrainStart{.strays = strays, .pulse = pulse, .certain = certain};
  };
  frames = frames.subspan(strays);
  if (frames.empty()) return all ? std::optional(verdict(0, false)) : std::nullopt;

  const auto counted = by_counter(frames.front(), strays, e);
  const Arrivals arrivals = arrivals_of(frames, e);
  const auto latest = static_cast<int64_t>(std::floor(arrivals.earliest + kEdgeError));
  if (latest <= 0) return verdict(0, true);
  if (!e.latency) {
    if (counted == e.broken && *counted <= latest) return verdict(*counted, true);
    if (!all) return std::nullopt;
    return verdict(std::min(counted.value_or(latest), latest), false);
  }
  const double arrived = arrivals.earliest - periods(*e.latency, e.period);
  const int64_t pulse = std::clamp<int64_t>(std::llround(arrived), 0, latest);
  const bool on_time = std::abs(arrived - static_cast<double>(pulse)) < kLargestHesitation;
  if (on_time && counted == pulse && pulse == e.broken) return verdict(pulse, true);
  if (!all) return std::nullopt;
  const bool proved = on_time && arrivals.steady && counted.value_or(pulse) == pulse;
  return verdict(std::min(pulse, counted.value_or(pulse)), proved);
}

}  // namespace v3d
