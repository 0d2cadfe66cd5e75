// The action generator with cameras that are UDP sockets on loopback addresses.
#include "trigger/action_generator.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <map>
#include <vector>

#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d::trigger {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

constexpr char kAddress[] = "127.0.0.21";
/// So slow, and with so long a lead, that a machine skips a pulse only when it is 50 ms late.
constexpr double kRateHz = 4;
constexpr double kLeadMs = 100;
constexpr int64_t kPtpAhead = 1'800'000'000'000'000'000;  ///< PTP time minus CLOCK_MONOTONIC, ns

/// Receives commands and acknowledges them.
class Socket {
 public:
  Socket() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_port = htons(io::kGvcpPort);
    inet_pton(AF_INET, kAddress, &own.sin_addr);
    is_bound_ = bind(fd_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0;
  }
  bool is_bound() const { return is_bound_; }
  /// The next command; empty when none comes within 20 s.
  std::optional<io::ActionCommand> receive() {
    pollfd readable{fd_.get(), POLLIN, 0};
    if (poll(&readable, 1, 20'000) <= 0) return std::nullopt;
    std::array<uint8_t, 64> bytes{};
    socklen_t length = sizeof sender_;
    const ssize_t size = recvfrom(fd_.get(), bytes.data(), bytes.size(), 0,
                                  reinterpret_cast<sockaddr*>(&sender_), &length);
    return io::decode_action_command(std::span(bytes).first(static_cast<size_t>(size)));
  }
  void acknowledge(uint16_t request, io::ActionStatus status = io::ActionStatus::kSuccess) {
    const std::vector<uint8_t> bytes =
        encode(io::ActionAcknowledgement{.status = status, .request = request});
    sendto(fd_.get(), bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&sender_),
           sizeof sender_);
  }

 private:
  io::UniqueFd fd_;
  bool is_bound_ = false;
  sockaddr_in sender_{};
};

StudioAction action() {
  StudioAction action;
  action.keys = {.signal = 1, .device_key = 7, .group_key = 8, .group_mask = 9};
  action.lead_ms = kLeadMs;
  action.broadcast = kAddress;
  action.cameras = {{"cam01", kAddress}};
  return action;
}

int64_t ptp_now() { return to_ns(Monotonic::now()) + kPtpAhead; }

TEST(ActionGenerator, schedules_evenly_spaced_pulses_and_senses_what_is_acknowledged) {
  Socket camera;
  ASSERT_TRUE(camera.is_bound());
  ActionGenerator generator(action(), ptp_now);
  const auto sensor = generator.own_sensor();
  generator.arm({kRateHz, milliseconds(1), {}});
  sensor->reset();
  generator.start();
  std::map<int64_t, int64_t> times;  // of the commands, by pulse
  const MonotonicInstant deadline = Monotonic::now() + seconds(60);
  for (int sensed_pulses = 0; sensed_pulses < 5;) {
    ASSERT_LT(Monotonic::now(), deadline);
    const auto command = camera.receive();
    ASSERT_TRUE(command && command->time_ns);
    EXPECT_EQ(command->device_key, 7U);
    EXPECT_EQ(command->group_key, 8U);
    EXPECT_EQ(command->group_mask, 9U);
    EXPECT_TRUE(command->wants_acknowledgement);
    times[command->request - 1] = *command->time_ns - kPtpAhead;
    camera.acknowledge(command->request);
    const auto sensed = sensor->wait(from_ns<Monotonic>(*command->time_ns - kPtpAhead) +
                                     ActionAcknowledgements::kDeadline);
    if (!sensed) continue;  // a busy host acknowledged it too late
    ++sensed_pulses;
    ASSERT_TRUE(times.contains(sensed->number));
    EXPECT_NEAR(static_cast<double>(times[sensed->number]), static_cast<double>(to_ns(sensed->at)),
                1e6);
    EXPECT_EQ(to_ns(sensed->at) - to_ns(*generator.first_pulse()), sensed->number * 250'000'000);
  }
  const auto [first, first_time] = *times.begin();
  for (const auto& [pulse, time] : times) {
    EXPECT_EQ(time - first_time, (pulse - first) * 250'000'000);
  }
  generator.stop();
  EXPECT_TRUE(generator.finished());
  EXPECT_GE(generator.commanded(), 5);
}

TEST(ActionGenerator, continues_without_acknowledgements_and_names_the_camera) {
  ActionGenerator generator(action(), ptp_now);
  const auto sensor = generator.own_sensor();
  generator.arm({kRateHz, milliseconds(1), 3});
  generator.start();
  const auto is_over = [&] {
    return generator.finished() && generator.statistics().acks_missing == 3 - generator.skipped();
  };
  const MonotonicInstant deadline = Monotonic::now() + seconds(60);
  while (!is_over() && Monotonic::now() < deadline) {
    EXPECT_FALSE(sensor->wait(Monotonic::now() + milliseconds(10)));
  }
  ASSERT_TRUE(is_over());
  EXPECT_EQ(generator.warning(), std::to_string(3 - generator.skipped()) +
                                     " acknowledgements of action commands missing: cam01");
  EXPECT_EQ(generator.statistics().acks_rejected, 0);
  EXPECT_EQ(generator.commanded(), 3);
}

TEST(ActionGenerator, counts_commands_that_a_camera_rejects) {
  Socket camera;
  ASSERT_TRUE(camera.is_bound());
  ActionGenerator generator(action(), ptp_now);
  generator.arm({kRateHz, milliseconds(1), {}});
  EXPECT_EQ(generator.statistics().acks_rejected, 0);
  generator.start();
  const MonotonicInstant deadline = Monotonic::now() + seconds(20);
  while (generator.statistics().acks_rejected == 0 && Monotonic::now() < deadline) {
    const auto command = camera.receive();
    ASSERT_TRUE(command);
    camera.acknowledge(command->request, io::ActionStatus::kNoReferenceTime);
  }
  EXPECT_GT(generator.statistics().acks_rejected, 0);
}

TEST(ActionGenerator, sends_commands_without_a_time_where_the_clocks_differ) {
  Socket camera;
  ASSERT_TRUE(camera.is_bound());
  ActionGenerator generator(action(), ptp_now);
  generator.arm({kRateHz, milliseconds(1), 1});
  generator.set_clock_fault("cam01 does not follow PTP");
  generator.start();
  const auto command = camera.receive();
  ASSERT_TRUE(command);
  EXPECT_FALSE(command->time_ns);
  EXPECT_THAT(generator.warning(),
              HasSubstr("action commands have no scheduled time: cam01 does not follow PTP"));
  generator.arm({kRateHz, milliseconds(1), 1});
  EXPECT_EQ(generator.warning(), "") << "the next train is scheduled";
}

TEST(ActionGenerator, reports_a_clock_that_is_set_during_the_train) {
  Socket camera;
  ASSERT_TRUE(camera.is_bound());
  std::atomic<int64_t> step = 0;
  ActionGenerator generator(action(), [&] { return ptp_now() + step; });
  generator.arm({kRateHz, milliseconds(1), {}});
  generator.start();
  const auto first = camera.receive();
  step = 5'000'000;
  const auto second = camera.receive();
  const auto third = camera.receive();
  ASSERT_TRUE(first && second && third);
  EXPECT_EQ(*third->time_ns - *first->time_ns,
            int64_t{third->request - first->request} * 250'000'000)
      << "the spacing stays";
  // A busy host may have received commands that were sent before the step.
  const MonotonicInstant deadline = Monotonic::now() + seconds(60);
  while (generator.fault().find("clock") == std::string::npos && Monotonic::now() < deadline) {
    ASSERT_TRUE(camera.receive());
  }
  generator.stop();
  EXPECT_EQ(generator.fault(), "the clock of this PC was set during the train");
}

TEST(ActionGenerator, reports_an_address_without_a_route) {
  StudioAction unreachable = action();
  unreachable.broadcast = "240.0.0.1";
  ActionGenerator generator(unreachable);
  EXPECT_THAT(test::message_of<InputError>([&] {
                generator.arm({25, milliseconds(1), 1});
              }),
              HasSubstr("action trigger: 240.0.0.1"));
}

}  // namespace
}  // namespace v3d::trigger
