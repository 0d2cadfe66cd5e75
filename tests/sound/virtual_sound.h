// A sound device, a pulse generator and a host in virtual time, for tests of pulse maps.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "sound/pulse_mapper.h"

namespace v3d::test {

struct VirtualSoundFaults {
  double sound_ppm = 80;           ///< the sample clock is fast by this
  double wander_ppm = 2;           ///< amplitude of a slow change of it, period 10 min
  double pulses_ppm = -15;         ///< the generator of the pulses is fast by this
  double pulse_jitter_s = 20e-6;   ///< standard deviation of the pulses
  double stamp_jitter_s = 0.2e-3;  ///< time stamps of blocks are late by this, in the mean
  double late_stamps = 0.01;       ///< share of stamps that are up to 8 ms later
  double edge_noise = 0.1;         ///< samples
  double lost_edges = 0.02;        ///< share of pulses without an edge
  double extra_edges = 0.005;      ///< per pulse
  int lost_bursts = 3;             ///< runs of 100 pulses without an edge
  double xruns_per_s = 1.0 / 120;
  double fill_error_s = 2e-3;  ///< standard deviation of the estimated length of an xrun
};

/// Runs a mapper over `seconds` of virtual time.
class VirtualSound {
 public:
  VirtualSound(const sound::PulseMapper::Setup& setup, double seconds,
               const VirtualSoundFaults& faults, unsigned seed)
      : setup_(setup), seconds_(seconds), faults_(faults), random_(seed), mapper_(setup) {
    make_xruns();
    make_pulses();
    run();
  }

  const sound::PulseMapper& mapper() const { return mapper_; }
  /// The true position of each pulse, samples. Within a gap: in proportion of its time.
  const std::vector<double>& truth() const { return truth_; }
  size_t xruns() const { return xruns_.size(); }

  /// Absolute errors of a map over all pulses, s, ascending.
  std::vector<double> errors(const sound::PulseMap& map) const {
    std::vector<double> errors;
    for (size_t n = 0; n < truth_.size(); ++n) {
      const double error = map.sample_of(static_cast<double>(n)) - truth_[n];
      errors.push_back(std::abs(error) / setup_.rate_hz);
    }
    std::ranges::sort(errors);
    return errors;
  }

 private:
  struct Xrun {
    double begin = 0, end = 0;  ///< of the lost samples, as the device counts them
    double filled = 0;          ///< samples of silence in the file
  };

  double normal(double deviation) {
    return std::normal_distribution(0.0, 1.0)(random_) * deviation;
  }
  double uniform(double low, double high) {
    return std::uniform_real_distribution(low, high)(random_);
  }

  /// Samples of the device at a time.
  double device_sample(double t) const {
    const double w = 2 * std::numbers::pi / 600;
    return setup_.rate_hz *
           (t * (1 + 1e-6 * faults_.sound_ppm) + 1e-6 * faults_.wander_ppm / w * std::sin(w * t));
  }
  double file_sample(double device) const {
    double shift = 0;
    for (const Xrun& x : xruns_) {
      if (device < x.begin) break;
      const double lost = x.end - x.begin;
      if (device < x.end) return x.begin + shift + (device - x.begin) / lost * x.filled;
      shift += x.filled - lost;
    }
    return device + shift;
  }

  void make_xruns() {
    if (faults_.xruns_per_s <= 0) return;
    for (double t = 5;;) {
      t += std::exponential_distribution(faults_.xruns_per_s)(random_) + 1;
      if (t > seconds_) return;
      const double begin = std::floor(device_sample(t));
      const double length = std::floor(uniform(0.02, 0.5) * setup_.rate_hz);
      const double filled =
          std::max(1.0, std::round(length + normal(faults_.fill_error_s) * setup_.rate_hz));
      xruns_.push_back({begin, begin + length, filled});
    }
  }

  void make_pulses() {
    const double period = (1 - 1e-6 * faults_.pulses_ppm) / setup_.pulse_rate_hz;
    for (int n = 0; kTrainStart + n * period < seconds_ - 0.1; ++n) {
      pulses_.push_back(kTrainStart + n * period + normal(faults_.pulse_jitter_s));
      truth_.push_back(file_sample(device_sample(pulses_.back())));
    }
    std::vector<size_t> bursts;
    for (int i = 0; i < faults_.lost_bursts; ++i) bursts.push_back(random_() % pulses_.size());
    for (size_t n = 0; n < pulses_.size(); ++n) {
      const bool in_burst = std::ranges::any_of(bursts, [&](size_t b) { return n - b < 100; });
      const double device = device_sample(pulses_[n]);
      const bool in_gap = std::ranges::any_of(
          xruns_, [&](const Xrun& x) { return device >= x.begin && device < x.end; });
      if (!in_burst && !in_gap && uniform(0, 1) > faults_.lost_edges) {
        edges_.push_back(truth_[n] + normal(faults_.edge_noise));
      }
      if (uniform(0, 1) < faults_.extra_edges) {
        edges_.push_back(uniform(0, seconds_) * setup_.rate_hz);
      }
    }
    std::ranges::sort(edges_);
  }

  static MonotonicInstant instant(double t) {
    return from_ns<Monotonic>(std::llround((1000 + t) * 1e9));
  }

  void run() {
    double device = 0;
    size_t xrun = 0, pulse = 0, edge = 0;
    while (true) {
      if (xrun < xruns_.size() && device >= xruns_[xrun].begin) {
        const Xrun& x = xruns_[xrun++];
        const auto begin = std::llround(file_sample(x.begin));
        mapper_.add_gap(begin, std::llround(x.filled), from_seconds(faults_.fill_error_s));
        device = x.end;
      }
      device += kBlock;
      if (xrun < xruns_.size()) device = std::min(device, xruns_[xrun].begin);
      const double t = time_of(device);
      if (t > seconds_) break;
      double late = std::abs(normal(faults_.stamp_jitter_s));
      if (uniform(0, 1) < faults_.late_stamps) late += uniform(0, 8e-3);
      for (; pulse < pulses_.size() && pulses_[pulse] + 5e-3 < t; ++pulse) {
        mapper_.add_pulse(static_cast<int64_t>(pulse),
                          instant(pulses_[pulse] + std::abs(normal(50e-6))));
      }
      mapper_.add_stamp(std::llround(file_sample(device)), instant(t + late));
      const double searched = file_sample(device) - 0.5 * setup_.rate_hz;
      std::vector<double> found;
      while (edge < edges_.size() && edges_[edge] < searched) found.push_back(edges_[edge++]);
      if (setup_.has_pulse_channel) mapper_.add_edges(found, searched);
    }
    if (setup_.has_pulse_channel) {
      mapper_.add_edges(std::span(edges_).subspan(edge), seconds_ * 2 * setup_.rate_hz);
    }
    mapper_.finish();
  }

  /// The inverse of device_sample().
  double time_of(double device) const {
    double t = device / setup_.rate_hz;
    for (int i = 0; i < 3; ++i) t -= (device_sample(t) - device) / setup_.rate_hz;
    return t;
  }

  static constexpr double kBlock = 480;
  static constexpr double kTrainStart = 3;  ///< s; the recording starts when the take is armed

  const sound::PulseMapper::Setup setup_;
  const double seconds_;
  const VirtualSoundFaults faults_;
  std::mt19937 random_;
  std::vector<Xrun> xruns_;
  std::vector<double> pulses_;  ///< s
  std::vector<double> truth_, edges_;
  sound::PulseMapper mapper_;
};

}  // namespace v3d::test
