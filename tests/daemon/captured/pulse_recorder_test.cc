#include "daemon/captured/pulse_recorder.h"

#include <gtest/gtest.h>

#include <deque>
#include <thread>

#include "support/child_process.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr Duration kPeriod = std::chrono::milliseconds(40);

/// Senses three pulses.
class ThreePulses : public trigger::PulseSensor {
 public:
  void reset() override {}
  std::optional<trigger::SensedPulse> wait(MonotonicInstant deadline) override {
    if (next_ == 3) {
      std::this_thread::sleep_until(deadline);
      return std::nullopt;
    }
    const int number = next_++;
    return trigger::SensedPulse{.number = number, .at = began_ + kPeriod * number};
  }
  std::string fault() const override { return ""; }

 private:
  const MonotonicInstant began_ = Monotonic::now();
  int next_ = 0;
};

TEST(PulseRecorder, repeats_the_last_pulse_because_its_loss_would_not_be_noticed) {
  bus::Bus bus(kUrl);
  bus::Subscription<wire::PulseMessage> received(bus, wire::kPulseChannel, 16);
  ThreePulses sensor;
  PulseRecorder recorder(&sensor, bus,
                         {.take = "kendo-07",
                          .train = {.rate_hz = 25, .width = kPeriod / 8, .count = 3},
                          .on_edge = [](const capture::PulseEdge&) {}});
  std::vector<int64_t> pulses;
  while (pulses.size() < 6) {
    const auto pulse = received.wait(test::within(10));
    ASSERT_TRUE(pulse) << "after " << pulses.size();
    pulses.push_back(pulse->pulse);
  }
  EXPECT_EQ(pulses, (std::vector<int64_t>{0, 1, 2, 2, 2, 2}));
  EXPECT_EQ(recorder.seen(), 3);
  EXPECT_EQ(received.counts().lost, 0) << "a repeated message is no gap";
}

}  // namespace
}  // namespace v3d::captured
