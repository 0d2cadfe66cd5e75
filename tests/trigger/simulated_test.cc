#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <thread>

#include "base/core/error.h"
#include "cable_server.h"
#include "slow_host.h"
#include "support/message_of.h"
#include "trigger/pulse_generator.h"
#include "trigger/simulated_trigger.h"

namespace v3d::trigger {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::IsEmpty;

PulseTrain train_of(double rate_hz, std::optional<int64_t> count) {
  return {rate_hz, std::chrono::microseconds(100), count};
}

bool eventually(const std::function<bool()>& condition) {
  const auto deadline = Monotonic::now() + seconds(10);
  while (!condition()) {
    if (Monotonic::now() > deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

std::string refusal(SimulatedGenerator& generator, const PulseTrain& train) {
  return test::message_of<InputError>([&] { generator.arm(train); });
}

TEST(SimulatedGenerator, makes_exactly_the_requested_number_of_pulses) {
  CableServer cable;
  SimulatedGenerator generator(cable.path());
  generator.arm(train_of(20, 7));
  EXPECT_THAT(cable.edges(), IsEmpty());
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_EQ(generator.commanded(), 7);
  const size_t sent = 7 - generator.skipped();
  EXPECT_EQ(generator.fault().empty(), sent == 7);
  ASSERT_TRUE(cable.wait_for_edges(sent));
  generator.arm(train_of(20, 1));  // joins the thread, so that all edges have been sent
  EXPECT_EQ(cable.edges().size(), sent);
}

TEST(SimulatedGenerator, stamps_edge_k_with_start_plus_k_periods) {
  CableServer cable;
  SimulatedGenerator generator(cable.path());
  generator.arm(train_of(40, 10));
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  ASSERT_TRUE(cable.wait_for_edges(10 - generator.skipped()));
  const auto edges = cable.edges();
  for (const int64_t edge : edges) EXPECT_EQ((edge - edges[0]) % 25'000'000, 0);
  EXPECT_LE(edges.back() - edges[0], 9 * 25'000'000);
}

/// The time at which pulse k is due, for a train of 25 Hz that was started at 100 s.
MonotonicInstant due(int k) { return MonotonicInstant(seconds(100) + milliseconds(20 + 40 * k)); }

std::vector<int64_t> stamps(std::initializer_list<int> pulses) {
  std::vector<int64_t> ns;
  for (const int k : pulses) ns.push_back(to_ns(due(k)));
  return ns;
}

TEST(SimulatedGenerator, sends_late_edges_with_the_times_at_which_they_were_due) {
  CableServer cable;
  SlowHost host({{due(2), milliseconds(999)}});
  SimulatedGenerator generator(cable.path(), host.clock());
  generator.arm(train_of(25, 5));
  EXPECT_FALSE(generator.first_pulse());
  generator.start();
  ASSERT_TRUE(cable.wait_for_edges(5));
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_EQ(cable.edges(), stamps({0, 1, 2, 3, 4}));
  EXPECT_EQ(generator.first_pulse(), due(0));
  EXPECT_EQ(generator.statistics().jitter_max, milliseconds(999));
  EXPECT_EQ(generator.skipped(), 0);
  EXPECT_EQ(generator.fault(), "");
}

TEST(SimulatedGenerator, skips_and_reports_edges_that_are_over_a_second_late) {
  CableServer cable;
  SlowHost host({{due(2), milliseconds(1055)}});
  SimulatedGenerator generator(cable.path(), host.clock());
  generator.arm(train_of(25, 6));
  generator.start();
  ASSERT_TRUE(cable.wait_for_edges(4));
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_EQ(cable.edges(), stamps({0, 1, 4, 5}));
  EXPECT_EQ(generator.commanded(), 6);
  EXPECT_EQ(generator.skipped(), 2);
  EXPECT_EQ(generator.fault(), "2 pulses skipped: this host was up to 1055 ms late");
}

TEST(SimulatedGenerator, finishes_the_train_when_its_last_pulse_is_skipped) {
  CableServer cable;
  SlowHost host({{due(2), milliseconds(1000)}});
  SimulatedGenerator generator(cable.path(), host.clock());
  generator.arm(train_of(25, 3));
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  ASSERT_TRUE(cable.wait_for_edges(2));
  EXPECT_EQ(generator.commanded(), 3);
  EXPECT_EQ(generator.skipped(), 1);
}

TEST(SimulatedGenerator, starts_the_train_when_it_can_send_the_first_edge) {
  CableServer cable;
  SlowHost host({{due(0), milliseconds(500)}});
  SimulatedGenerator generator(cable.path(), host.clock());
  generator.arm(train_of(25, 2));
  generator.start();
  ASSERT_TRUE(cable.wait_for_edges(2));
  EXPECT_EQ(cable.edges().front(), to_ns(due(0) + milliseconds(500)));
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_EQ(generator.skipped(), 0);
}

TEST(SimulatedGenerator, sends_no_edge_after_stop_returns) {
  CableServer cable;
  SimulatedGenerator generator(cable.path());
  generator.arm(train_of(500, {}));
  generator.start();
  ASSERT_TRUE(cable.wait_for_edges(5));
  generator.stop();
  const MonotonicInstant stopped = Monotonic::now();
  generator.stop();
  EXPECT_TRUE(generator.finished());
  const int64_t commanded = generator.commanded();
  // The server echoes an edge when it reads it, to clients that connected after it was sent, too.
  ASSERT_TRUE(cable.wait_for_edges(static_cast<size_t>(commanded - generator.skipped())));
  SimulatedSensor sensor(cable.path());
  sensor.reset();
  EXPECT_FALSE(sensor.wait(stopped + milliseconds(50)));
  EXPECT_EQ(generator.commanded(), commanded);
  for (const int64_t edge : cable.edges()) EXPECT_LT(edge, to_ns(stopped));
}

TEST(SimulatedGenerator, can_be_started_again_and_counts_from_zero) {
  CableServer cable;
  SimulatedGenerator generator(cable.path());
  for (int round = 0; round < 3; ++round) {
    generator.arm(train_of(20, 2));
    EXPECT_EQ(generator.commanded(), 0);
    generator.start();
    ASSERT_TRUE(eventually([&] { return generator.finished(); }));
    EXPECT_EQ(generator.commanded(), 2);
  }
}

TEST(SimulatedGenerator, rejects_impossible_trains) {
  CableServer cable;
  SimulatedGenerator generator(cable.path());
  for (const double rate : {0.0, -25.0, 1e9, std::nan(""), double(INFINITY)}) {
    EXPECT_THAT(refusal(generator, train_of(rate, {})), HasSubstr("0.01 to 1000 Hz")) << rate;
  }
  EXPECT_THAT(refusal(generator, train_of(25, 0)), HasSubstr("at least 1"));
  EXPECT_THAT(refusal(generator, {25, milliseconds(40), {}}), HasSubstr("less than the period"));
  EXPECT_THAT(refusal(generator, {25, milliseconds(0), {}}), HasSubstr("less than the period"));
}

TEST(SimulatedGenerator, names_a_missing_wire) {
  SimulatedGenerator absent("/nonexistent/cable");
  EXPECT_THAT(refusal(absent, train_of(25, {})), HasSubstr("/nonexistent/cable"));
  SimulatedGenerator endless(std::string(200, 'x'));
  EXPECT_THAT(refusal(endless, train_of(25, {})), HasSubstr("characters"));
}

TEST(SimulatedGenerator, reports_a_connection_that_is_lost_during_a_train) {
  CableServer cable;
  SimulatedGenerator generator(cable.path());
  generator.arm(train_of(100, {}));
  generator.start();
  ASSERT_TRUE(cable.wait_for_edges(3));
  cable.vanish();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_THAT(generator.fault(), HasSubstr("connection lost"));
  generator.stop();
}

TEST(SimulatedSensor, counts_the_edges_and_keeps_their_stamps) {
  CableServer cable;
  SimulatedSensor sensor(cable.path());
  sensor.reset();
  ASSERT_TRUE(cable.wait_for_clients(1));
  SimulatedGenerator generator(cable.path());
  generator.arm(train_of(20, 5));
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  ASSERT_TRUE(cable.wait_for_edges(5 - generator.skipped()));
  int64_t number = 0;
  for (const int64_t edge : cable.edges()) {
    const auto pulse = sensor.wait(Monotonic::now() + seconds(10));
    ASSERT_TRUE(pulse);
    EXPECT_EQ(pulse->number, number++);
    EXPECT_EQ(to_ns(pulse->at), edge);
  }
}

TEST(SimulatedSensor, discards_unread_edges_at_reset) {
  CableServer cable;
  SimulatedSensor sensor(cable.path());
  sensor.reset();
  ASSERT_TRUE(cable.wait_for_clients(1));
  SimulatedGenerator generator(cable.path());
  generator.arm(train_of(50, {}));
  generator.start();
  ASSERT_TRUE(cable.wait_for_edges(2));
  EXPECT_EQ(sensor.wait(Monotonic::now() + seconds(10))->number, 0);
  generator.stop();
  ASSERT_TRUE(cable.wait_for_edges(generator.commanded() - generator.skipped()));
  generator.arm(train_of(50, {}));
  sensor.reset();
  const MonotonicInstant forgotten = Monotonic::now();
  generator.start();
  const auto pulse = sensor.wait(Monotonic::now() + seconds(10));
  ASSERT_TRUE(pulse);
  EXPECT_EQ(pulse->number, 0);
  EXPECT_GT(pulse->at, forgotten);
}

TEST(SimulatedSensor, reports_a_lost_connection_and_connects_again_at_reset) {
  CableServer cable;
  SimulatedSensor sensor(cable.path());
  EXPECT_THAT(sensor.fault(), HasSubstr("not connected"));
  sensor.reset();
  EXPECT_EQ(sensor.fault(), "");
  cable.vanish();
  EXPECT_FALSE(sensor.wait(Monotonic::now() + milliseconds(1)));
  EXPECT_THAT(sensor.fault(), HasSubstr("connection lost"));
  EXPECT_THROW(sensor.reset(), InputError);
}

TEST(SimulatedSensor, reports_a_lost_connection_while_another_thread_waits) {
  CableServer cable;
  SimulatedSensor sensor(cable.path());
  sensor.reset();
  std::atomic<bool> reported = false;
  std::thread waiting([&] {
    while (!reported) sensor.wait(Monotonic::now() + milliseconds(5));
  });
  cable.vanish();
  EXPECT_TRUE(eventually([&] { return !sensor.fault().empty(); }));
  reported = true;
  waiting.join();
}

TEST(SimulatedSensor, treats_a_packet_that_is_not_an_edge_as_a_lost_connection) {
  CableServer cable;
  SimulatedSensor sensor(cable.path());
  sensor.reset();
  ASSERT_TRUE(cable.wait_for_clients(1));
  cable.send_to_all("hello, this is no edge");
  EXPECT_FALSE(sensor.wait(Monotonic::now() + seconds(1)));
  EXPECT_THAT(sensor.fault(), HasSubstr("connection lost"));
}

TEST(MakeTrigger, makes_the_generator_and_the_sensor_of_the_studio_file) {
  CableServer cable;
  StudioTrigger trigger;
  trigger.wire = cable.path();
  const auto generator = make_generator(trigger);
  generator->arm({25, milliseconds(1), 1});
  const auto sensor = make_sensor(trigger, *generator);
  sensor->reset();
  EXPECT_EQ(generator->fault() + sensor->fault(), "");
}

}  // namespace
}  // namespace v3d::trigger
