// FreeRunningCamera with simulated pulses and a simulated clock.
#include <gtest/gtest.h>

#include <numeric>

#include "base/core/error.h"
#include "capture/cameras/camera.h"

namespace v3d::capture {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kPeriod = milliseconds(40);

/// State of the simulated camera. Time advances only in Camera::wait().
struct Bench {
  MonotonicInstant now{seconds(1000)};
  std::deque<MonotonicInstant> exposures;  ///< future exposures
  double rate_hz = 0;
  int starts = 0;
  bool rejects_start = false;  ///< start() throws
};

class TickingCamera : public Camera {
 public:
  explicit TickingCamera(Bench& bench) : bench_(bench) {}
  void start() override {
    if (bench_.rejects_start) throw InputError("camera cam01: rate: expected 30, found 25");
    ++bench_.starts;
  }
  void stop() override {}
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override {
    if (bench_.exposures.empty() || bench_.exposures.front() > deadline) {
      bench_.now = deadline;
      return {};
    }
    CameraFrame frame;
    frame.received = bench_.now = std::max(bench_.now, bench_.exposures.front());
    frame.device_time = from_ns<DeviceClock>(to_ns(bench_.exposures.front()));
    bench_.exposures.pop_front();
    return frame;
  }
  CameraStatistics statistics() const override { return {}; }
  bool lost() const override { return false; }
  ImageSize size() const override { return {4, 4}; }
  PixelFormat format() const override { return PixelFormat::kMono8; }

 private:
  Bench& bench_;
};

class FreeRunningCameraTest : public testing::Test {
 protected:
  FreeRunningCameraTest() {
    camera_.start();
    pulses_.begin(kPeriod);
  }
  /// Schedules frames at the nominal rate, from the start of the test.
  void run_for(int64_t frames) {
    for (int64_t i = 0; i < frames; ++i) bench_.exposures.push_back(start_ + i * kPeriod);
  }
  std::vector<int64_t> labels_until(MonotonicInstant end) {
    std::vector<int64_t> labels;
    while (bench_.now < end && !camera_.lost()) {
      const auto frame = camera_.wait(bench_.now + milliseconds(20));
      if (frame) labels.push_back(frame->pulse.value());
    }
    return labels;
  }

  Bench bench_;
  const MonotonicInstant start_ = bench_.now;
  PulseTimes pulses_{kPeriod};
  FreeRunningCamera camera_{std::make_unique<TickingCamera>(bench_),
                            [this](double hz) { bench_.rate_hz = hz; }, pulses_,
                            [this] { return bench_.now; }};
};

TEST_F(FreeRunningCameraTest, delivers_no_frames_before_and_after_the_pulses) {
  run_for(100);
  EXPECT_TRUE(labels_until(start_ + milliseconds(500)).empty());
  for (int64_t pulse = 0; pulse < 10; ++pulse) {
    pulses_.add(pulse, start_ + milliseconds(807) + pulse * kPeriod);
  }
  EXPECT_EQ(labels_until(start_ + seconds(3)),
            (std::vector<int64_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(camera_.statistics().phase, Duration(-milliseconds(7)));
}

TEST_F(FreeRunningCameraTest, does_not_reuse_the_phase_of_the_previous_train) {
  run_for(200);
  std::vector<int64_t> all(20);
  std::iota(all.begin(), all.end(), 0);
  // Phases at the limit of the hysteresis with respect to the previous train.
  for (const Duration phase : {Duration(milliseconds(12)), Duration(-milliseconds(16))}) {
    pulses_.begin(kPeriod);
    const MonotonicInstant first = bench_.now + milliseconds(400);
    const MonotonicInstant begin = first - (first - start_) % kPeriod - phase;
    for (int64_t pulse = 0; pulse < 20; ++pulse) {
      const Duration jitter = microseconds(pulse < 10 ? 100 : -100);
      pulses_.add(pulse, begin + pulse * kPeriod + jitter);
    }
    EXPECT_EQ(labels_until(bench_.now + milliseconds(1600)), all);
  }
}

TEST_F(FreeRunningCameraTest, labels_every_pulse_once_if_frames_lie_half_way_between_pulses) {
  std::vector<int64_t> all(20);
  std::iota(all.begin(), all.end(), 0);
  for (const Duration jitter : {Duration(microseconds(500)), Duration(-microseconds(500))}) {
    pulses_.begin(kPeriod);
    const MonotonicInstant first = bench_.now + milliseconds(420);
    // The frame before pulse 0 is too early or too late by the jitter, the frame after it
    // inversely.
    for (int64_t i = -10; i < 25; ++i) {
      bench_.exposures.push_back(first - kPeriod / 2 + i * kPeriod +
                                 (i % 2 == 0 ? jitter : -jitter));
    }
    for (int64_t pulse = 0; pulse < 20; ++pulse) pulses_.add(pulse, first + pulse * kPeriod);
    EXPECT_EQ(labels_until(bench_.now + seconds(2)), all);
  }
}

TEST_F(FreeRunningCameraTest, skips_the_pulses_of_lost_frames) {
  run_for(100);
  for (int64_t pulse = 0; pulse < 90; ++pulse) pulses_.add(pulse, start_ + pulse * kPeriod);
  bench_.exposures.erase(bench_.exposures.begin() + 3, bench_.exposures.begin() + 6);
  EXPECT_EQ(labels_until(start_ + milliseconds(330)), (std::vector<int64_t>{0, 1, 2, 6, 7, 8}));
}

TEST_F(FreeRunningCameraTest, runs_at_the_rate_of_the_take) {
  EXPECT_NEAR(bench_.rate_hz, 25, 1e-9);
  pulses_.begin(milliseconds(100));
  camera_.wait(bench_.now + milliseconds(20));
  EXPECT_NEAR(bench_.rate_hz, 10, 1e-9);
  EXPECT_EQ(bench_.starts, 2);
  bench_.rejects_start = true;
  pulses_.begin(milliseconds(33));
  camera_.wait(bench_.now + milliseconds(20));
  EXPECT_TRUE(camera_.lost());
  EXPECT_THROW(camera_.start(), InputError);
}

TEST_F(FreeRunningCameraTest, is_lost_without_frames_even_if_there_are_no_pulses) {
  run_for(10);
  labels_until(start_ + seconds(1));
  EXPECT_FALSE(camera_.lost());
  labels_until(start_ + seconds(2));
  EXPECT_TRUE(camera_.lost());
  camera_.start();
  EXPECT_FALSE(camera_.lost());
}

}  // namespace
}  // namespace v3d::capture
