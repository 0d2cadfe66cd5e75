#include "daemon/captured/pulse_recorder.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <atomic>
#include <limits>
#include <memory>
#include <thread>

#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "take/logs/event_log.h"
#include "take/logs/frame_log.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr Duration kPeriod = std::chrono::milliseconds(40);

/// Senses spikes while the train is not started, and then three pulses.
class ThreePulses : public trigger::PulseSensor {
 public:
  explicit ThreePulses(int spikes = 0) : next_(-spikes) {}
  void reset() override {}
  std::optional<trigger::SensedPulse> wait(MonotonicInstant deadline) override {
    if (next_ == 3 || (next_ == 0 && !is_started_)) {
      std::this_thread::sleep_until(deadline);
      return std::nullopt;
    }
    const int number = next_++;
    return trigger::SensedPulse{.number = number, .at = first_pulse() + kPeriod * number};
  }
  std::string fault() const override { return ""; }

  MonotonicInstant first_pulse() const { return first_pulse_; }
  /// Call after PulseRecorder::start().
  void start() { is_started_ = true; }

 private:
  const MonotonicInstant first_pulse_ = Monotonic::now();
  int next_;
  std::atomic<bool> is_started_ = false;
};

class RecorderOfThreePulses : public testing::Test {
 protected:
  /// The numbers in the messages about three pulses, of which the last one is sent four times.
  std::vector<int64_t> published(ThreePulses& sensor) {
    recorder_ = std::make_unique<PulseRecorder>(
        &sensor, bus_,
        PulseRecorder::Setup{.take = "kendo-07",
                             .train = {.rate_hz = 25, .width = kPeriod / 8, .count = 3},
                             .on_edge = [](const capture::PulseEdge&) {}});
    recorder_->start(sensor.first_pulse());
    sensor.start();
    std::vector<int64_t> pulses;
    while (pulses.size() < 6) {
      const auto pulse = received_.wait(test::within(10));
      if (!pulse) break;
      pulses.push_back(pulse->pulse);
    }
    return pulses;
  }

  bus::Bus bus_{kUrl};
  bus::Subscription<wire::PulseMessage> received_{bus_, wire::kPulseChannel, 16};
  std::unique_ptr<PulseRecorder> recorder_;
};

TEST_F(RecorderOfThreePulses, repeats_the_last_pulse_because_its_loss_would_not_be_noticed) {
  ThreePulses sensor;
  EXPECT_EQ(published(sensor), (std::vector<int64_t>{0, 1, 2, 2, 2, 2}));
  EXPECT_EQ(recorder_->seen(), 3);
  EXPECT_EQ(received_.counts().lost, 0) << "a repeated message is no gap";
  recorder_->close();
}

TEST_F(RecorderOfThreePulses, counts_pulses_before_the_start_of_the_train_as_extra) {
  ThreePulses sensor(2);
  EXPECT_EQ(published(sensor), (std::vector<int64_t>{0, 1, 2, 2, 2, 2}));
  EXPECT_EQ(recorder_->warning(), "2 extra pulses");
  take::Ledger ledger;
  recorder_->fill_ledger(ledger, 3);
  EXPECT_EQ(ledger.extra, 2);
  EXPECT_EQ(ledger.sensed, 3);
  recorder_->close();
}

TEST(PulseRecorder, logs_the_time_of_each_pulse_on_the_clock_of_this_pc) {
  const test::TemporaryFolder folder;
  bus::Bus bus(kUrl);
  ThreePulses sensor;
  PulseRecorder recorder(&sensor, bus,
                         {.take = "kendo-07",
                          .train = {.rate_hz = 25, .width = kPeriod / 8, .count = 3},
                          .log = folder / "pulses.lcmlog",
                          .on_edge = [](const capture::PulseEdge&) {}});
  recorder.start(sensor.first_pulse());
  sensor.start();
  ASSERT_TRUE(test::becomes_true([&] { return recorder.seen() == 3; }, test::within(30)));
  recorder.close();
  const take::EventLogReader log(folder / "pulses.lcmlog");
  const auto pulses = take::read_pulses(log);
  ASSERT_EQ(pulses.size(), 3U);
  for (size_t i = 0; i < pulses.size(); ++i) {
    EXPECT_NE(log.events()[i].utime, to_ns(pulses[i].sent) / 1000);
    EXPECT_LE(std::abs(log.events()[i].utime - to_ns(pulses[i].edge) / 1000), 50'000)
        << "the wall clock may be corrected meanwhile";
  }
}

/// A pulse, the message about it, and its reception on another PC.
struct Transfer {
  Duration offset{};      ///< wall clock of the sender minus that of the receiver
  Duration sent_after{};  ///< time from the pulse to the sending
  Duration age{};         ///< time from the sending to the reception
  Duration min_delay{};   ///< of earlier messages; the comparison of the clocks lacks it
  Duration set_back{};    ///< step of the sender's clock since clocks were compared
  bool is_authentic = true;

  /// Error of the time of the pulse.
  std::optional<Duration> error() const {
    const bus::ReceiverTime now{.monotonic = MonotonicInstant(std::chrono::seconds(500)),
                                .realtime = RealtimeInstant(std::chrono::hours(500'000))};
    const RealtimeInstant sent = now.realtime - age + offset;
    wire::PulseMessage pulse;
    pulse.pulse = 7;
    pulse.edge = sent - sent_after;
    bus::ReceivedMessage in;
    if (is_authentic) {
      in.age = age - min_delay + set_back;
      in.sent = sent;
      in.sent_here = now.monotonic - in.age;
    }
    const capture::PulseEdge edge = edge_on_this_pc(pulse, in, now);
    EXPECT_EQ(edge.pulse, 7);
    if (!edge.is_timed) return std::nullopt;
    return edge.at - (now.monotonic - age - sent_after);
  }
};

Duration any_ms(int least, int most) {
  return std::chrono::microseconds(*rc::gen::inRange(1000 * least, 1000 * most + 1));
}

RC_GTEST_PROP(EdgeOnThisPc, is_exact_however_late_the_message_is_if_the_clocks_are_synchronised,
              ()) {
  const Transfer transfer{
      .sent_after = any_ms(0, 4000), .age = any_ms(5, 4000), .min_delay = any_ms(0, 2)};
  RC_ASSERT(transfer.error() == Duration::zero());
}

/// The latency of a camera is longer. With a larger error, the frame of the next pulse would seem
/// to be of this one.
RC_GTEST_PROP(EdgeOnThisPc, is_late_by_at_most_2_ms_more_than_the_least_delay_for_any_clocks, ()) {
  const Duration offset = *rc::gen::arbitrary<bool>() ? any_ms(0, 60) : any_ms(0, 2000);
  const Transfer transfer{.offset = offset * *rc::gen::elementOf(std::vector{-1, 1}),
                          .sent_after = any_ms(0, 4000),
                          .age = any_ms(5, 10),
                          .min_delay = any_ms(0, 5)};
  const auto error = transfer.error();
  RC_ASSERT(error.has_value());
  RC_ASSERT(std::chrono::abs(*error - transfer.min_delay) <= std::chrono::milliseconds(2));
}

RC_GTEST_PROP(EdgeOnThisPc, is_late_by_the_least_delay_of_a_message_if_the_clocks_differ, ()) {
  const Transfer transfer{.offset = any_ms(8, 1'000'000) * *rc::gen::elementOf(std::vector{-1, 1}),
                          .sent_after = any_ms(0, 4000),
                          .age = any_ms(5, 10),
                          .min_delay = any_ms(0, 5)};
  RC_ASSERT(transfer.error() == transfer.min_delay);
}

RC_GTEST_PROP(EdgeOnThisPc, is_unknown_if_the_clocks_differ_and_the_message_may_be_late, ()) {
  const Transfer transfer{.offset = any_ms(8, 1'000'000) * *rc::gen::elementOf(std::vector{-1, 1}),
                          .sent_after = any_ms(0, 4000),
                          .age = any_ms(16, 4000),
                          .min_delay = any_ms(0, 5)};
  RC_ASSERT(transfer.error() == std::nullopt);
}

RC_GTEST_PROP(EdgeOnThisPc, is_exact_or_unknown_after_the_clock_of_the_sender_was_set_back, ()) {
  const Transfer transfer{.sent_after = any_ms(0, 4000), .set_back = any_ms(11, 5000)};
  RC_ASSERT(transfer.error().value_or(Duration::zero()) == Duration::zero());
}

TEST(EdgeOnThisPc, is_unknown_of_an_old_message_that_nothing_authenticates) {
  using std::chrono::milliseconds;
  Transfer transfer{.age = milliseconds(150), .is_authentic = false};
  EXPECT_EQ(transfer.error(), Duration::zero());
  transfer.age = milliseconds(250);
  EXPECT_EQ(transfer.error(), std::nullopt);
  transfer = {.offset = milliseconds(300), .age = milliseconds(1), .is_authentic = false};
  EXPECT_EQ(transfer.error(), std::nullopt);
}

TEST(EdgeOnThisPc, is_unknown_if_the_time_in_the_message_is_nonsense) {
  for (const int64_t ns :
       {std::numeric_limits<int64_t>::min(), int64_t{0}, std::numeric_limits<int64_t>::max()}) {
    wire::PulseMessage pulse;
    pulse.edge = from_ns<Realtime>(ns);
    bus::ReceivedMessage in;
    EXPECT_FALSE(edge_on_this_pc(pulse, in, bus::ReceiverTime::now()).is_timed);
    in.sent = Realtime::now();
    in.sent_here = Monotonic::now();
    EXPECT_FALSE(edge_on_this_pc(pulse, in, bus::ReceiverTime::now()).is_timed);
  }
}

}  // namespace
}  // namespace v3d::captured
