// A thousand cameras in trouble, ten thousand frames each: no frame may get a wrong pulse number
// without being suspect.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <optional>
#include <random>
#include <string>
#include <utility>

#include "capture/cameras/frame_counter.h"
#include "capture/sync/pulse_matcher.h"

namespace v3d {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(40);
constexpr int kScripts = 1000;
constexpr int kFramesOfScript = 10'000;

enum class Fault {
  kLost,       ///< frames lost in transport
  kMissed,     ///< triggers that the camera did not see
  kExtra,      ///< an exposure between two pulses
  kDuplicate,  ///< a frame comes again, later
  kReordered,  ///< a frame comes after those that follow it
  kLate,       ///< a frame is delivered late, and those behind it wait
  kStall,      ///< the host stands still; what was exposed comes at once
  kStepped,    ///< the device clock
  kCounted,    ///< the counter jumps, or begins anew
  kCycled,     ///< the camera begins anew, unnoticed
  kReopened,   ///< it was lost and opened again; its clock went on
  kReplaced,   ///< it was lost and opened again; its clock began anew
};
constexpr int kFaults = 12;

/// Faults of one witness hide those of another when they err alike; the matcher says so.
bool of_clock(Fault f) { return f == Fault::kStepped; }
bool of_counter(Fault f) {
  return f == Fault::kMissed || f == Fault::kExtra || f == Fault::kCounted || f == Fault::kReopened;
}
constexpr int64_t kApart = 200;  ///< pulses between them

/// A camera, its way to the host, and a random script of what happens to both.
class FaultyCamera {
 public:
  static constexpr int64_t kNoPulse = -1;

  struct Arrival {
    FrameStamp stamp;          ///< its counter as the camera sends it
    int64_t pulse = 0;         ///< that exposed it
    bool opened_anew = false;  ///< the camera was opened again before this frame
  };

  explicit FaultyCamera(unsigned seed) : random_(seed) {
    device_rate_ = 1 + uniform(-200, 200) * 1e-6;
    host_rate_ = 1 + uniform(-100, 100) * 1e-6;
    device_offset_ns_ = std::llround(uniform(0, 1e15));
    jitter_ = uniform(0, 0.1);
    hesitation_ = uniform(0, 0.3);
    wide_ = chance(0.3);
    exposures_ = whole(0, 200'000);
    next_fault_ = whole(100, 500);
  }

  /// The frames that the next pulse brings: none, one or several.
  std::deque<Arrival> next() {
    arrivals_.clear();
    if (pulse_ == next_fault_) begin_fault();
    expose();
    ++pulse_;
    return std::exchange(arrivals_, {});
  }

  int64_t faults() const { return faults_; }
  /// The last fault that began.
  std::string story() const {
    return "fault " + std::to_string(static_cast<int>(fault_)) + " at pulse " +
           std::to_string(fault_pulse_);
  }
  /// No fault begins any more.
  void spare() { next_fault_ = -1; }

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
    if (of_clock(fault_) && pulse_ < counter_erred_ + kApart) fault_ = Fault::kDuplicate;
    if (of_counter(fault_) && pulse_ < clock_erred_ + kApart) fault_ = Fault::kDuplicate;
    if (of_clock(fault_)) clock_erred_ = pulse_;
    if (of_counter(fault_)) counter_erred_ = pulse_;
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
        free_again_ = static_cast<double>(pulse_) + uniform(0, 3);
        break;
      case Fault::kStall:
        free_again_ = static_cast<double>(pulse_) + uniform(1, 60);
        break;
      case Fault::kStepped:
        step_clock();
        break;
      case Fault::kCounted:
        exposures_ = chance(0.3) ? 0 : exposures_ + whole(1, 1000);
        break;
      case Fault::kCycled:
        lose(whole(10, 100));
        counter_anew_ = clock_anew_ = true;
        break;
      case Fault::kReopened:
      case Fault::kReplaced:
        lose(whole(3, 100));
        opened_anew_ = counter_anew_ = true;
        clock_anew_ = fault_ == Fault::kReplaced;
        break;
    }
  }

  void step_clock() {
    constexpr std::array kLongest = {1.0, 5.0, 1e3, 1e9};
    double periods = uniform(-1, 1) * kLongest[static_cast<size_t>(whole(0, 3))];
    // A shorter step is no more than jitter.
    if (chance(0.5) || std::abs(periods) < 0.26)
      periods = std::copysign(std::ceil(std::abs(periods)), periods);
    device_offset_ns_ += std::llround(periods * static_cast<double>(kPeriod.count()));
  }

  void lose(int64_t frames) { lose_ = std::max(lose_, frames); }

  /// After the frames that were lost.
  void begin_anew() {
    if (std::exchange(counter_anew_, false)) exposures_ = 0;
    if (std::exchange(clock_anew_, false)) {
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
      if (--lose_ == 0) begin_anew();
      return;
    }
    const auto period = static_cast<double>(kPeriod.count());
    Arrival a;
    a.pulse = pulse;
    a.stamp.exposed =
        from_ns<DeviceClock>(device_offset_ns_ + std::llround((when + uniform(-jitter_, jitter_)) *
                                                              period * device_rate_));
    a.stamp.counter = static_cast<uint64_t>(wide_ ? exposures_ : (exposures_ - 1) % 65535 + 1);
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
    delivered_ = std::max({delivered_, free_again_, when + uniform(0, hesitation_)});
    a.stamp.received = from_ns<Monotonic>(
        std::llround(delivered_ * static_cast<double>(kPeriod.count()) * host_rate_));
    a.opened_anew = std::exchange(opened_anew_, false);
    arrivals_.push_back(a);
  }

  std::mt19937 random_;
  double device_rate_, host_rate_, jitter_, hesitation_;
  int64_t device_offset_ns_;
  bool wide_;          ///< counts with 64 bits
  int64_t exposures_;  ///< since the camera began

  int64_t pulse_ = 0;
  int64_t next_fault_;
  Fault fault_ = Fault::kLost;
  int64_t fault_pulse_ = -1000;
  int64_t faults_ = 0;
  int64_t clock_erred_ = -1000;    ///< last, pulse
  int64_t counter_erred_ = -1000;  ///< last, pulse
  int64_t lose_ = 0;
  bool counter_anew_ = false;
  bool clock_anew_ = false;
  int64_t miss_ = 0;
  bool extra_ = false;
  int64_t hold_for_ = 0;
  std::optional<Arrival> held_;
  int64_t copy_after_ = -1;
  std::optional<Arrival> copy_;
  bool opened_anew_ = false;
  double free_again_ = 0;  ///< the host, pulses
  double delivered_ = 0;   ///< the last frame, pulses
  std::deque<Arrival> arrivals_;
};

/// The host's side of a script.
struct Score {
  int64_t frames = 0;
  int64_t suspect = 0;
  int64_t faults = 0;
  std::string wrong;   ///< the first frame that got a wrong number silently
  bool clear = false;  ///< the last frame was not suspect
};

Score play(unsigned seed) {
  FaultyCamera camera(seed);
  PulseMatcher matcher(kPeriod);
  FrameCounter counter;
  Score score;
  while (score.frames < kFramesOfScript) {
    if (score.frames > kFramesOfScript - 500) camera.spare();
    for (const FaultyCamera::Arrival& a : camera.next()) {
      if (a.opened_anew) {
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
                      " was called " + std::to_string(match.pulse) + " after " + camera.story();
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
  EXPECT_LT(suspect, 3 * faults) << "suspicion must not outlive its reason";
}

}  // namespace
}  // namespace v3d
