// Randomised faults of PulseMatcher: 1000 simulated cameras with 10,000 frames each. Every frame
// with a wrong pulse number must be suspect.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <optional>
#include <random>
#include <string>
#include <utility>

#include "capture/cameras/aravis_camera.h"
#include "capture/sync/pulse_matcher.h"

namespace v3d::capture {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(40);
constexpr int kScripts = 1000;
constexpr int kFramesOfScript = 10'000;

enum class Fault {
  kLost,       ///< frames are lost in transport
  kMissed,     ///< the camera does not detect triggers
  kExtra,      ///< an exposure between two pulses
  kDuplicate,  ///< a frame arrives again later
  kReordered,  ///< a frame arrives after those that follow it
  kLate,       ///< a frame is delivered late and delays those after it
  kStall,      ///< the host stalls; then all exposed frames arrive at once
  kStepped,    ///< the device clock steps
  kCounted,    ///< the counter jumps or restarts
  kCycled,     ///< the camera restarts unnoticed
  kReopened,   ///< the camera is lost and reopened; its clock keeps running
  kReplaced,   ///< the camera is lost and reopened; its clock restarts
};
constexpr int kFaults = 12;

// Equal errors of clock and counter are a documented limit of PulseMatcher. So faults of one and
// faults of the other are at least kMinDistance pulses apart.
bool of_clock(Fault f) { return f == Fault::kStepped; }
bool of_counter(Fault f) {
  return f == Fault::kMissed || f == Fault::kExtra || f == Fault::kCounted || f == Fault::kReopened;
}
constexpr int64_t kMinDistance = 200;

/// Simulated camera and transport with random faults.
class FaultyCamera {
 public:
  static constexpr int64_t kNoPulse = -1;

  struct Arrival {
    FrameStamp stamp;       ///< with the counter as the camera sends it
    int64_t pulse = 0;      ///< true pulse of the frame
    bool reopened = false;  ///< the camera was reopened before this frame
  };

  explicit FaultyCamera(unsigned seed) : random_(seed) {
    device_rate_ = 1 + uniform(-200, 200) * 1e-6;
    host_rate_ = 1 + uniform(-100, 100) * 1e-6;
    device_offset_ns_ = std::llround(uniform(0, 1e15));
    jitter_ = uniform(0, 0.1);
    arrival_jitter_ = uniform(0, 0.3);
    is_64_bit_ = chance(0.3);
    exposures_ = whole(0, 200'000);
    next_fault_ = whole(100, 500);
  }

  /// The frames that arrive at the next pulse: none, one or several.
  std::deque<Arrival> next() {
    arrivals_.clear();
    if (pulse_ == next_fault_) begin_fault();
    expose();
    ++pulse_;
    return std::exchange(arrivals_, {});
  }

  int64_t faults() const { return faults_; }
  /// Description of the last fault.
  std::string last_fault() const {
    return "fault " + std::to_string(static_cast<int>(fault_)) + " at pulse " +
           std::to_string(fault_pulse_);
  }
  /// Starts no further fault.
  void stop_faults() { next_fault_ = -1; }

 private:
  double uniform(double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 32>(random_);
  }
  int64_t whole(int64_t low, int64_t high) {
    return low + static_cast<int64_t>(uniform(0, static_cast<double>(high - low + 1)));
  }
  bool chance(double p) { return uniform(0, 1) < p; }

  void begin_fault() {
    ++faults_;
    next_fault_ += chance(0.2) ? whole(1, 10) : whole(1, 400);
    fault_ = static_cast<Fault>(whole(0, kFaults - 1));
    if (of_clock(fault_) && pulse_ < last_counter_fault_ + kMinDistance) fault_ = Fault::kDuplicate;
    if (of_counter(fault_) && pulse_ < last_clock_fault_ + kMinDistance) fault_ = Fault::kDuplicate;
    if (of_clock(fault_)) last_clock_fault_ = pulse_;
    if (of_counter(fault_)) last_counter_fault_ = pulse_;
    fault_pulse_ = pulse_;
    switch (fault_) {
      case Fault::kLost:
        lose(chance(0.5) ? whole(1, 3) : whole(1, 100));
        break;
      case Fault::kMissed:
        miss_ = whole(1, 3);
        break;
      case Fault::kExtra:
        extra_ = true;
        break;
      case Fault::kDuplicate:
        copy_after_ = whole(0, 3);
        break;
      case Fault::kReordered:
        hold_for_ = whole(1, 3);
        break;
      case Fault::kLate:
        delayed_until_ = static_cast<double>(pulse_) + uniform(0, 3);
        break;
      case Fault::kStall:
        delayed_until_ = static_cast<double>(pulse_) + uniform(1, 60);
        break;
      case Fault::kStepped:
        step_clock();
        break;
      case Fault::kCounted:
        exposures_ = chance(0.3) ? 0 : exposures_ + whole(1, 1000);
        break;
      case Fault::kCycled:
        lose(whole(10, 100));
        counter_restarts_ = clock_restarts_ = true;
        break;
      case Fault::kReopened:
      case Fault::kReplaced:
        lose(whole(3, 100));
        reopened_ = counter_restarts_ = true;
        clock_restarts_ = fault_ == Fault::kReplaced;
        break;
    }
  }

  void step_clock() {
    constexpr std::array kMaxSteps = {1.0, 5.0, 1e3, 1e9};
    double periods = uniform(-1, 1) * kMaxSteps[static_cast<size_t>(whole(0, 3))];
    // Rounds half of the steps, and all that are as small as jitter, up to whole periods.
    if (chance(0.5) || std::abs(periods) < 0.26)
      periods = std::copysign(std::ceil(std::abs(periods)), periods);
    device_offset_ns_ += std::llround(periods * static_cast<double>(kPeriod.count()));
  }

  void lose(int64_t frames) { lose_ = std::max(lose_, frames); }

  /// Restarts counter and clock after the lost frames.
  void restart_counter_and_clock() {
    if (std::exchange(counter_restarts_, false)) exposures_ = 0;
    if (std::exchange(clock_restarts_, false)) {
      device_offset_ns_ = -std::llround(static_cast<double>(pulse_ * kPeriod.count()));
    }
  }

  void expose() {
    if (extra_) exposure(static_cast<double>(pulse_) - uniform(0.36, 0.64), kNoPulse);
    extra_ = false;
    if (miss_ > 0) {
      --miss_;
      return;
    }
    exposure(static_cast<double>(pulse_), pulse_);
  }

  void exposure(double when, int64_t pulse) {
    ++exposures_;
    if (lose_ > 0) {
      if (--lose_ == 0) restart_counter_and_clock();
      return;
    }
    const auto period = static_cast<double>(kPeriod.count());
    Arrival a;
    a.pulse = pulse;
    a.stamp.exposed =
        from_ns<DeviceClock>(device_offset_ns_ + std::llround((when + uniform(-jitter_, jitter_)) *
                                                              period * device_rate_));
    a.stamp.counter = static_cast<uint64_t>(is_64_bit_ ? exposures_ : (exposures_ - 1) % 65535 + 1);
    hand_over(a, when);
  }

  void hand_over(const Arrival& a, double when) {
    if (hold_for_ > 0 && !held_) {
      held_ = a;
      return;
    }
    deliver(a, when);
    if (held_ && --hold_for_ == 0) {
      deliver(*held_, when);
      held_.reset();
    }
    if (copy_after_ >= 0 && !copy_) copy_ = a;
    if (copy_ && copy_after_-- == 0) {
      deliver(*copy_, when);
      copy_.reset();
    }
  }

  void deliver(Arrival a, double when) {
    delivered_ = std::max({delivered_, delayed_until_, when + uniform(0, arrival_jitter_)});
    a.stamp.received = from_ns<Monotonic>(
        std::llround(delivered_ * static_cast<double>(kPeriod.count()) * host_rate_));
    a.reopened = std::exchange(reopened_, false);
    arrivals_.push_back(a);
  }

  std::mt19937 random_;
  double device_rate_, host_rate_, jitter_, arrival_jitter_;
  int64_t device_offset_ns_;
  bool is_64_bit_;     ///< the counter has 64 bits
  int64_t exposures_;  ///< since the camera started

  int64_t pulse_ = 0;
  int64_t next_fault_;
  Fault fault_ = Fault::kLost;
  int64_t fault_pulse_ = -1000;
  int64_t faults_ = 0;
  int64_t last_clock_fault_ = -1000;    ///< pulse of the last fault of the clock
  int64_t last_counter_fault_ = -1000;  ///< pulse of the last fault of the counter
  int64_t lose_ = 0;
  bool counter_restarts_ = false;
  bool clock_restarts_ = false;
  int64_t miss_ = 0;
  bool extra_ = false;
  int64_t hold_for_ = 0;
  std::optional<Arrival> held_;
  int64_t copy_after_ = -1;
  std::optional<Arrival> copy_;
  bool reopened_ = false;
  double delayed_until_ = 0;  ///< end of the host's delay, in pulses
  double delivered_ = 0;      ///< arrival of the last frame, in pulses
  std::deque<Arrival> arrivals_;
};

/// Result of one simulated camera.
struct Score {
  int64_t frames = 0;
  int64_t suspect = 0;
  int64_t faults = 0;
  std::string wrong;   ///< first frame with a wrong number that was not suspect; empty: none
  bool clear = false;  ///< the last frame was not suspect
};

Score play(unsigned seed) {
  FaultyCamera camera(seed);
  PulseMatcher matcher(kPeriod);
  FrameCounter counter;
  Score score;
  while (score.frames < kFramesOfScript) {
    if (score.frames > kFramesOfScript - 500) camera.stop_faults();
    for (const FaultyCamera::Arrival& a : camera.next()) {
      if (a.reopened) {
        matcher.reopened();
        counter = {};
      }
      FrameStamp stamp = a.stamp;
      stamp.counter = counter.unwrap(stamp.counter);
      const PulseMatch match = matcher.label(stamp);
      ++score.frames;
      score.suspect += match.suspect;
      score.clear = !match.suspect;
      if (match.pulse != a.pulse && !match.suspect && score.wrong.empty()) {
        score.wrong = "script " + std::to_string(seed) + ": pulse " + std::to_string(a.pulse) +
                      " was labelled " + std::to_string(match.pulse) + " after " +
                      camera.last_fault();
      }
    }
  }
  score.faults = camera.faults();
  return score;
}

TEST(PulseFaults, no_frame_of_ten_million_gets_a_wrong_pulse_number_silently) {
  int64_t frames = 0;
  int64_t suspect = 0;
  int64_t faults = 0;
  for (unsigned script = 0; script < kScripts; ++script) {
    const Score score = play(script);
    EXPECT_EQ(score.wrong, "");
    EXPECT_TRUE(score.clear) << "script " << script << " is suspect to its end";
    frames += score.frames;
    suspect += score.suspect;
    faults += score.faults;
  }
  EXPECT_GE(frames, 10'000'000);
  EXPECT_GE(faults, 50'000);
  EXPECT_LT(suspect, 3 * faults) << "frames after a fault stay suspect for too long";
}

}  // namespace
}  // namespace v3d::capture
