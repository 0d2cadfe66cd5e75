#include "sound/pulse_mapper.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/core/statistics.h"

namespace v3d::sound {
namespace {

/// Share of a period within which an edge can belong to a pulse.
constexpr double kMaxGate = 0.45;
/// A longer lag of the edges, in periods, shows that they belong to other pulses.
constexpr double kMaxLag = 0.5;
/// Edges within this of their expected position belong to the pulse, s.
constexpr double kMinGate = 0.5e-3;
constexpr double kGateDeviations = 5;
/// Pulses that decide where the edges of the train are.
constexpr size_t kAcquired = 12;
/// At least this many of them must agree within kAgreement; fewer where fewer pulses follow.
constexpr int64_t kAgreeing = 5;
constexpr int64_t kMinAgreeing = 3;
constexpr double kAgreement = 1e-3;  ///< s
/// Deviation of the position that they give, s.
constexpr double kStartDeviation = 0.2e-3;
/// Edges of a train: the jitter of a pulse generator by software is below 0.2 ms.
constexpr ClockFilter::Noise kTrainNoise{.pair = 0.2e-3};

}  // namespace

std::string_view name(MapSource source) {
  switch (source) {
    case MapSource::kPulseChannel:
      return "pulse channel";
    case MapSource::kTimeStamps:
      return "time stamps";
    default:
      return "none";
  }
}

PulseMapper::PulseMapper(const Setup& setup)
    : setup_(setup),
      period_(setup.rate_hz / setup.pulse_rate_hz),
      clock_(setup.rate_hz),
      coarse_map_(setup.tolerance_s * setup.rate_hz),
      train_(kTrainNoise),
      edge_map_(setup.tolerance_s * setup.rate_hz) {}

// --- time stamps --------------------------------------------------------------------------------

void PulseMapper::add_stamp(int64_t samples, MonotonicInstant at) {
  clock_.add_stamp(samples, at);
  if (clock_.is_known()) place_pulses(at);
}

void PulseMapper::add_pulse(int64_t pulse, MonotonicInstant at) {
  if (!first_pulse_) first_pulse_ = pulse;
  last_pulse_ = pulse;
  unplaced_.emplace_back(pulse, at);
  if (unplaced_.size() > kMaxWaiting) unplaced_.pop_front();
}

void PulseMapper::place_pulses(MonotonicInstant until) {
  for (; !unplaced_.empty() && unplaced_.front().second <= until; unplaced_.pop_front()) {
    const auto& [number, at] = unplaced_.front();
    const Pulse pulse{.number = number, .coarse = clock_.sample_at(at)};
    coarse_map_.add({.pulse = static_cast<double>(number), .sample = pulse.coarse});
    if (!setup_.has_pulse_channel) continue;
    pulses_.push_back(pulse);
    if (pulses_.size() > kMaxWaiting) pulses_.pop_front();
  }
}

void PulseMapper::add_gap(int64_t sample, int64_t length, Duration deviation) {
  const Gap gap{.begin = static_cast<double>(sample), .end = static_cast<double>(sample + length)};
  clock_.add_gap(deviation);
  coarse_map_.add_gap(gap.begin, gap.end, period_ * (1 + 1e-6 * clock_.drift_ppm()));
  gaps_.push_back(gap);
  if (gaps_.size() > kMaxWaiting) gaps_.pop_front();
}

// --- pulse channel ------------------------------------------------------------------------------

void PulseMapper::add_edges(std::span<const double> edges, double searched) {
  edges_.insert(edges_.end(), edges.begin(), edges.end());
  while (edges_.size() > kMaxWaiting) edges_.pop_front();
  match(searched);
}

void PulseMapper::finish() {
  match(std::numeric_limits<double>::infinity());
  add_coarse_points();
}

void PulseMapper::match(double searched) {
  while (!pulses_.empty()) {
    const Pulse pulse = pulses_.front();
    apply_gaps(pulse.coarse + lag_);
    if (!is_tracking_ && !acquire(searched)) return;
    if (!is_tracking_) continue;  // the first pulse has no edge
    const Expected expected = this->expected(pulse);
    if (expected.sample + expected.gate > searched) return;
    pulses_.pop_front();
    track(pulse, take_edge(expected));
  }
}

/// Finds the edges of the next pulses: those near the coarse positions that are a period apart.
/// False when more edges must come first. Where too few edges agree, removes the first pulse.
bool PulseMapper::acquire(double searched) {
  // A gap interrupts the train. It is known before the pulses behind it.
  const double end = gaps_.empty() ? std::numeric_limits<double>::infinity() : gaps_.front().begin;
  size_t count = 0;
  while (count < std::min(pulses_.size(), kAcquired) && pulses_[count].coarse + lag_ <= end)
    ++count;
  const bool is_last = std::isinf(searched) || count < std::min(pulses_.size(), kAcquired);
  if (count < kAcquired && !is_last) return false;
  const double gate = kMaxGate * period_;
  if (pulses_[count - 1].coarse + lag_ + gate > searched) return false;
  const Pulse first = pulses_.front();
  std::vector<double> starts;  // positions of the first pulse, from each edge
  for (size_t i = 0; i < count; ++i) {
    const double expected = pulses_[i].coarse + lag_;
    const double edge = nearest_edge(expected);
    if (std::abs(edge - expected) > gate) continue;
    const auto periods = static_cast<double>(pulses_[i].number - first.number);
    starts.push_back(edge - periods * samples_per_pulse());
  }
  const double start = upper_median(starts);
  const int64_t agreeing = std::ranges::count_if(
      starts, [&](double s) { return std::abs(s - start) <= kAgreement * setup_.rate_hz; });
  if (agreeing < std::clamp<int64_t>(static_cast<int64_t>(count), kMinAgreeing, kAgreeing)) {
    miss(first);
    pulses_.pop_front();
    return true;
  }
  lag_ = start - first.coarse;
  constexpr double kUnknown = 1;  // s
  if (train_.has_started()) train_.jump(kUnknown);
  train_.add(train_seconds(first), start / setup_.rate_hz);
  train_.jump(kStartDeviation);
  is_tracking_ = true;
  missed_ = 0;
  return true;
}

double PulseMapper::nearest_edge(double sample) const {
  const auto after = std::ranges::lower_bound(edges_, sample);
  double nearest = std::numeric_limits<double>::infinity();
  if (after != edges_.end()) nearest = *after;
  if (after != edges_.begin() && sample - *(after - 1) < nearest - sample) nearest = *(after - 1);
  return nearest;
}

PulseMapper::Expected PulseMapper::expected(const Pulse& pulse) const {
  const double x = train_seconds(pulse);
  const double deviation = std::hypot(train_.deviation_at(x), train_.pair_deviation());
  const double gate = std::max(kMinGate, kGateDeviations * deviation) * setup_.rate_hz;
  return {.sample = train_.at(x) * setup_.rate_hz, .gate = std::min(gate, kMaxGate * period_)};
}

/// Removes the edges up to the end of the gate, and returns the one nearest to the expected
/// position.
std::optional<double> PulseMapper::take_edge(const Expected& expected) {
  std::optional<double> nearest;
  for (; !edges_.empty() && edges_.front() <= expected.sample + expected.gate; edges_.pop_front()) {
    const double edge = edges_.front();
    const double distance = std::abs(edge - expected.sample);
    ++extra_;
    if (distance > expected.gate) continue;
    if (!nearest || distance < std::abs(*nearest - expected.sample)) nearest = edge;
  }
  if (nearest) --extra_;
  return nearest;
}

void PulseMapper::track(const Pulse& pulse, std::optional<double> edge) {
  if (!edge) {
    miss(pulse);
    if (++missed_ >= static_cast<int>(kAcquired)) is_tracking_ = false;
    return;
  }
  missed_ = 0;
  ++matched_;
  has_edge_since_gap_ = true;
  without_edges_.clear();
  train_.add(train_seconds(pulse), *edge / setup_.rate_hz);
  constexpr double kLagGain = 0.02;
  lag_ += kLagGain * (*edge - pulse.coarse - lag_);
  edge_map_.add({.pulse = static_cast<double>(pulse.number), .sample = *edge});
  if (std::abs(lag_) > kMaxLag * period_) {
    lag_ = 0;
    is_tracking_ = false;
  }
}

void PulseMapper::miss(const Pulse& pulse) {
  ++missing_;
  if (has_edge_since_gap_) return;
  // The first and the last such pulse define a line.
  if (without_edges_.size() == 2) without_edges_.pop_back();
  without_edges_.push_back(
      {.pulse = static_cast<double>(pulse.number), .sample = pulse.coarse + lag_});
}

/// A part of the sound without edges has coarse positions alone.
void PulseMapper::add_coarse_points() {
  for (const PulseMap::Knot& point : without_edges_) edge_map_.add(point);
  without_edges_.clear();
}

/// Applies the gaps before a position. The edges after a gap are searched again.
void PulseMapper::apply_gaps(double sample) {
  for (; !gaps_.empty() && gaps_.front().begin < sample; gaps_.pop_front()) {
    const Gap& gap = gaps_.front();
    add_coarse_points();
    has_edge_since_gap_ = false;
    edge_map_.add_gap(gap.begin, gap.end, samples_per_pulse());
    is_tracking_ = false;
  }
}

double PulseMapper::samples_per_pulse() const {
  const double drift = train_.has_started() ? train_.drift() : 1e-6 * clock_.drift_ppm();
  return period_ * (1 + drift);
}

/// Extends the map to the first and the last pulse with the slope of all lines: that of a single
/// short line is less exact.
void PulseMapper::extend(PulseMap& map, double slope) const {
  const PulseMap::Knot first = map.knots.front(), last = map.knots.back();
  const auto first_pulse = static_cast<double>(first_pulse_.value_or(0));
  const auto last_pulse = static_cast<double>(last_pulse_);
  if (slope <= 0) return;
  if (first_pulse < first.pulse) {
    map.knots.insert(map.knots.begin(),
                     {first_pulse, first.sample - slope * (first.pulse - first_pulse)});
  }
  if (last_pulse > last.pulse) {
    map.knots.push_back({last_pulse, last.sample + slope * (last_pulse - last.pulse)});
  }
}

// --- result -------------------------------------------------------------------------------------

MappedPulses PulseMapper::result() const {
  MappedPulses result;
  result.edges = matched_;
  result.missing_edges = missing_;
  result.extra_edges = extra_;
  const bool has_edges = matched_ >= 2;
  const PulseMapBuilder& builder = has_edges ? edge_map_ : coarse_map_;
  if (builder.points() < 2) return result;
  result.map = builder.map();
  extend(result.map, builder.slope());
  const double tolerance_s = builder.tolerance() / setup_.rate_hz;
  if (has_edges) {
    result.source = MapSource::kPulseChannel;
    result.uncertainty_s = std::hypot(tolerance_s, train_.pair_deviation());
    result.drift_ppm = 1e6 * (builder.slope() / period_ - 1);
  } else {
    result.source = MapSource::kTimeStamps;
    result.uncertainty_s =
        std::hypot(tolerance_s, clock_.stamp_deviation(), setup_.stamp_uncertainty_s);
    result.drift_ppm = clock_.drift_ppm();
  }
  return result;
}

}  // namespace v3d::sound
