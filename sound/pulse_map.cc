#include "sound/pulse_map.h"

#include <algorithm>
#include <utility>

#include "base/core/error.h"

namespace v3d::sound {
namespace {

using Knot = PulseMap::Knot;

/// Knots are at least this far apart, pulses and samples.
constexpr double kMinStep = 1e-6;

/// The value at `x` of the line through the two knots around it, as functions of one coordinate.
double interpolate(const std::vector<Knot>& knots, double x, double Knot::*from, double Knot::*to) {
  V3D_CHECK(knots.size() >= 2);
  const auto after = std::ranges::upper_bound(knots, x, {}, from);
  const auto right = std::clamp(after, knots.begin() + 1, knots.end() - 1);
  const Knot &a = *(right - 1), &b = *right;
  return a.*to + (x - a.*from) * (b.*to - a.*to) / (b.*from - a.*from);
}

}  // namespace

double PulseMap::sample_of(double pulse) const {
  return interpolate(knots, pulse, &Knot::pulse, &Knot::sample);
}

double PulseMap::pulse_of(double sample) const {
  return interpolate(knots, sample, &Knot::sample, &Knot::pulse);
}

void PulseMapBuilder::add(const Knot& point) {
  const bool ascends = points_ == 0 || (point.pulse > last_.pulse && point.sample > last_.sample);
  if (!ascends || (in_gap_ && !is_after_gap(point))) return;
  ++points_;
  if (knots_.empty() || in_gap_) {
    start_line(point);
  } else if (!extend_door(point)) {
    push(end_of_line());
    has_line_ = false;
    extend_door(point);
  }
  last_ = point;
}

/// The end of the gap may be an estimate, and behind the next points.
bool PulseMapBuilder::is_after_gap(const Knot& point) const {
  const Knot& before = knots_.back();
  return point.sample > gap_.begin && point.pulse > before.pulse + kMinStep &&
         point.sample > before.sample + kMinStep;
}

void PulseMapBuilder::start_line(const Knot& point) {
  in_gap_ = false;
  has_line_ = false;
  if (knots_.empty()) return push(point);
  // The line starts at the end of the gap, but after the line before it.
  const Knot before = knots_.back();
  const double pulse = point.pulse - (point.sample - gap_.begin) / gap_.slope;
  push({.pulse = std::max(pulse, before.pulse + kMinStep),
        .sample = std::max(gap_.begin, before.sample + kMinStep)});
  extend_door(point);
}

/// False when no line from the anchor is within the tolerance of all its points and this one.
bool PulseMapBuilder::extend_door(const Knot& point) {
  const Knot& anchor = knots_.back();
  const double run = point.pulse - anchor.pulse;
  const double least = (point.sample - tolerance_ - anchor.sample) / run;
  const double most = (point.sample + tolerance_ - anchor.sample) / run;
  const double min = has_line_ ? std::max(min_slope_, least) : least;
  const double max = has_line_ ? std::min(max_slope_, most) : most;
  if (min > max) return false;
  min_slope_ = min;
  max_slope_ = max;
  has_line_ = true;
  last_ = point;
  return true;
}

/// Where the open line ends: at its last point, within the door.
Knot PulseMapBuilder::end_of_line() const {
  const Knot& anchor = knots_.back();
  const double run = last_.pulse - anchor.pulse;
  double slope = std::clamp((last_.sample - anchor.sample) / run, min_slope_, max_slope_);
  // The anchor may be above the last point, by less than the tolerance. The door has ascending
  // lines then, too, because the points ascend.
  if (slope <= 0) slope = max_slope_ / 2;
  return {.pulse = last_.pulse, .sample = anchor.sample + slope * run};
}

void PulseMapBuilder::push(const Knot& knot) {
  if (has_line_ && !knots_.empty()) {
    covered_.pulse += knot.pulse - knots_.back().pulse;
    covered_.sample += knot.sample - knots_.back().sample;
  }
  knots_.push_back(knot);
  if (knots_.size() >= max_knots_) thin_out();
}

/// Doubles the tolerance, until at most half of the knots are necessary. The points are within the
/// first tolerance of the old knots, and these within the rest of the new one of the kept knots.
void PulseMapBuilder::thin_out() {
  const double first = tolerance_;
  std::vector<Knot> kept;
  do {
    tolerance_ *= 2;
    PulseMapBuilder thinned(tolerance_ - first);
    for (const Knot& knot : knots_) thinned.add(knot);
    kept = thinned.map().knots;
  } while (kept.size() > max_knots_ / 2);
  // The last one has the pulse of the old anchor. It is the anchor of the open line now.
  knots_ = std::move(kept);
}

void PulseMapBuilder::add_gap(double end, double begin, double slope) {
  gap_ = {.begin = begin, .slope = slope};
  if (knots_.empty() || in_gap_) return;
  in_gap_ = true;
  if (has_line_) push(end_of_line());
  has_line_ = false;
  const Knot last = knots_.back();
  if (end > last.sample) {
    push({.pulse = last.pulse + (end - last.sample) / slope, .sample = end});
  }
}

PulseMap PulseMapBuilder::map() const {
  PulseMap map{knots_};
  if (has_line_) map.knots.push_back(end_of_line());
  return map;
}

double PulseMapBuilder::slope() const {
  Knot all = covered_;
  if (has_line_) {
    const Knot end = end_of_line();
    all.pulse += end.pulse - knots_.back().pulse;
    all.sample += end.sample - knots_.back().sample;
  }
  return all.pulse > 0 ? all.sample / all.pulse : 0;
}

}  // namespace v3d::sound
