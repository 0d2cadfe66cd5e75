#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "base/core/text.h"
#include "sound/ltc.h"
#include "sound/sound_device.h"

namespace v3d::sound {
namespace {

constexpr double kPulseSeconds = 1e-3;
/// Delay of the samples. A pulse that a busy host reports later than this has no edge in them. Less
/// than a node waits for the last samples of a take.
constexpr Duration kLatency = std::chrono::milliseconds(300);
constexpr double kXrunSeconds = 0.1;
constexpr double kToneHz = 440;
constexpr double kToneLevel = 0.1;  // -20 dB
constexpr double kPulseLevel = 0.5;
constexpr Timecode kFirstTimecode = {10, 0, 0, 0};
constexpr Timecode kTimecodeAfterJump = {20, 0, 0, 0};
constexpr double kClapLevel = 0.9;
constexpr double kClapSeconds = 20e-3;

class SimulatedInput : public SoundInput {
 public:
  SimulatedInput(const StudioSound& sound, const SimulatedSound& options, TriggerPulseSource pulses)
      : sound_(sound),
        options_(options),
        pulse_source_(std::move(pulses)),
        start_(Monotonic::now()),
        ltc_(std::in_place, sound.rate_hz, TimecodeRate::k25, kFirstTimecode) {}

  io::Result<std::optional<SoundBlock>> read(Duration timeout) override {
    const int64_t length = sound_.rate_hz / 100;
    if (stalls_before(next_ + length)) {
      std::this_thread::sleep_for(timeout);
      return std::nullopt;
    }
    const MonotonicInstant due = time_of(static_cast<double>(next_ + length)) + kLatency;
    const MonotonicInstant until = std::min(due, Monotonic::now() + timeout);
    std::this_thread::sleep_for(std::max<Duration>(Duration(0), until - Monotonic::now()));
    if (until < due) return std::nullopt;
    lose_samples();
    take_pulses();
    SoundBlock block;
    block.position = delivered_;
    block.xruns = xruns_;
    for (int64_t i = 0; i < length; ++i) append_sample(block.values);
    delivered_ += length;
    block.at = time_of(static_cast<double>(next_));
    return block;
  }
  double stamp_uncertainty_s() const override { return 0; }

 private:
  double samples_per_second() const { return sound_.rate_hz * (1 + 1e-6 * options_.ppm); }
  MonotonicInstant time_of(double sample) const {
    return start_ + from_seconds(sample / samples_per_second());
  }

  bool stalls_before(int64_t sample) const {
    return options_.stall_s > 0 &&
           static_cast<double>(sample) > options_.stall_s * samples_per_second();
  }

  void lose_samples() {
    const double period = options_.xrun_s * sound_.rate_hz;
    if (period <= 0 || static_cast<double>(next_) < period * static_cast<double>(xruns_ + 1))
      return;
    ++xruns_;
    std::vector<int32_t> lost;
    const auto count = static_cast<int64_t>(kXrunSeconds * sound_.rate_hz);
    for (int64_t i = 0; i < count; ++i) append_sample(lost);
  }

  void take_pulses() {
    if (!pulse_source_) return;
    for (const MonotonicInstant at : pulse_source_()) {
      edges_.push_back(to_seconds(at - start_) * samples_per_second());
      if (++pulses_seen_ == std::llround(options_.clap_edge)) {
        clap_ = edges_.back() + 1e-3 * options_.clap_ms * samples_per_second();
      }
    }
    const double width = kPulseSeconds * sound_.rate_hz;
    while (!edges_.empty() && edges_.front() + 2 * width < static_cast<double>(next_)) {
      edges_.pop_front();
    }
  }

  void append_sample(std::vector<int32_t>& values) {
    if (ltc_samples_.empty()) {
      jump_once();
      const std::vector<float> frame = ltc_->next();
      ltc_samples_.assign(frame.begin(), frame.end());
    }
    const double ltc = ltc_samples_.front();
    ltc_samples_.pop_front();
    for (int channel = 1; channel <= sound_.channels; ++channel) {
      double value = 0;
      if (channel == 1) value = tone() + clap();
      if (channel == sound_.pulse_channel) value = pulses();
      if (channel == sound_.timecode_channel) value = ltc;
      values.push_back(static_cast<int32_t>(std::lround(value * 8'388'607)) * 256);
    }
    ++next_;
  }

  void jump_once() {
    const double at = options_.timecode_jump_s * sound_.rate_hz;
    if (at <= 0 || has_jumped_ || static_cast<double>(next_) < at) return;
    has_jumped_ = true;
    ltc_.emplace(sound_.rate_hz, TimecodeRate::k25, kTimecodeAfterJump);
  }

  double tone() const {
    return kToneLevel *
           std::sin(2 * std::numbers::pi * kToneHz * static_cast<double>(next_) / sound_.rate_hz);
  }
  /// Noise that decays.
  double clap() {
    const double t = static_cast<double>(next_) - clap_.value_or(1e300);
    if (t < 0) return 0;
    return (random_() % 2 == 0 ? kClapLevel : -kClapLevel) *
           std::exp(-t / (kClapSeconds * sound_.rate_hz));
  }
  double pulses() const {
    double value = 0;
    for (const double edge : edges_) {
      value += pulse_value(static_cast<double>(next_) - edge, kPulseSeconds * sound_.rate_hz);
    }
    return kPulseLevel * value;
  }

  const StudioSound sound_;
  const SimulatedSound options_;
  const TriggerPulseSource pulse_source_;
  const MonotonicInstant start_;
  std::optional<LtcWriter> ltc_;
  std::deque<float> ltc_samples_;
  bool has_jumped_ = false;
  std::deque<double> edges_;  ///< samples
  int64_t pulses_seen_ = 0;
  std::optional<double> clap_;  ///< sample of its onset
  std::mt19937 random_{1};
  int64_t next_ = 0;  ///< samples of the virtual converter
  int64_t delivered_ = 0;
  int64_t xruns_ = 0;
};

}  // namespace

double pulse_value(double t, double width) {
  const auto step = [](double x) { return 0.5 * (1 + std::erf(x / std::numbers::sqrt2)); };
  return step(t) - step(t - width);
}

std::optional<SimulatedSound> parse_simulated_sound(const std::string& device) {
  constexpr std::string_view kPrefix = "simulated:";
  std::string_view rest = device;
  if (!rest.starts_with(kPrefix)) return std::nullopt;
  rest.remove_prefix(kPrefix.size());
  SimulatedSound options;
  while (!rest.empty()) {
    const size_t equals = rest.find('=');
    if (equals == std::string_view::npos) return std::nullopt;
    const std::string_view key = rest.substr(0, equals);
    rest.remove_prefix(equals + 1);
    double* const value = key == "ppm"               ? &options.ppm
                          : key == "xrun_s"          ? &options.xrun_s
                          : key == "timecode_jump_s" ? &options.timecode_jump_s
                          : key == "stall_s"         ? &options.stall_s
                          : key == "clap_edge"       ? &options.clap_edge
                          : key == "clap_ms"         ? &options.clap_ms
                                                     : nullptr;
    if (value == nullptr || !consume_number(rest, *value)) return std::nullopt;
    if (!rest.empty() && rest.front() != ',') return std::nullopt;
    if (!rest.empty()) rest.remove_prefix(1);
  }
  const bool is_plausible = std::abs(options.ppm) <= 1000 && options.xrun_s >= 0 &&
                            options.timecode_jump_s >= 0 && options.stall_s >= 0 &&
                            options.clap_edge >= 0 && options.clap_ms >= 0;
  return is_plausible ? std::optional(options) : std::nullopt;
}

std::unique_ptr<SoundInput> make_simulated_input(const StudioSound& sound,
                                                 const SimulatedSound& options,
                                                 TriggerPulseSource pulses) {
  return std::make_unique<SimulatedInput>(sound, options, std::move(pulses));
}

io::Result<std::unique_ptr<SoundInput>> open_sound_input(const StudioSound& sound,
                                                         TriggerPulseSource pulses) {
  if (const auto simulated = parse_simulated_sound(sound.device)) {
    return make_simulated_input(sound, *simulated, std::move(pulses));
  }
  return open_alsa_input(sound);
}

}  // namespace v3d::sound
