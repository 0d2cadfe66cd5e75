#include <gtest/gtest.h>

#include "daemon/node/node_health.h"
#include "daemon/node/peer_health.h"
#include "support/child_process.h"
#include "wire/messages.h"

namespace v3d::node {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

constexpr char kTake[] = "kendo-07";

wire::HealthMessage health_of(const std::string& node, int64_t seq, const std::string& take,
                              double full) {
  wire::HealthMessage health;
  health.node = node;
  health.seq = seq;
  health.take = take;
  health.values[kDiskFull] = full;
  return health;
}

void report(bus::Bus& bus, const std::string& node, double full) {
  const wire::HealthMessage health = health_of(node, 1, kTake, full);
  bus.publish(wire::health_channel(node), encode(health));
}

class FullDiskStateTest : public testing::Test {
 protected:
  /// A message of the node, which is not received yet.
  ReceivedHealth next(const std::string& take, double full) {
    return {
        .health = health_of("cap02", seq_++, take, full), .session = 1, .received = {}, .sent = {}};
  }
  void receive(ReceivedHealth message) {
    message.received = message.sent = now_;
    disk_.on_health(message, kTake);
  }

  MonotonicInstant now_ = from_ns<Monotonic>(0) + std::chrono::hours(1);
  int64_t seq_ = 1;
  FullDiskState disk_;
};

TEST_F(FullDiskStateTest, is_full_when_the_node_has_ended_its_part_of_the_take) {
  disk_.reset(now_);
  receive(next(kTake, 0));
  EXPECT_FALSE(disk_.is_full());
  receive(next("", 1));
  EXPECT_TRUE(disk_.is_full());
}

TEST_F(FullDiskStateTest, is_not_full_by_a_late_report_about_the_take_before) {
  const ReceivedHealth early = next("", 1);
  const ReceivedHealth late = next("", 1);
  disk_.note(early);
  disk_.reset(now_);
  receive(late);
  EXPECT_FALSE(disk_.is_full()) << "seed 20182841 of the simulator";
  receive(next(kTake, 0));
  receive(late);
  EXPECT_FALSE(disk_.is_full());
}

TEST_F(FullDiskStateTest, is_full_when_the_report_cannot_be_from_before_the_take) {
  disk_.reset(now_);
  now_ += kMaxHealthAge + std::chrono::milliseconds(1);
  receive(next("", 1));
  EXPECT_TRUE(disk_.is_full());
}

TEST(DiskMonitor, finds_the_node_whose_disk_is_full) {
  bus::Bus bus(kUrl);
  DiskMonitor monitor(bus, {"cap02", "cap03"});
  EXPECT_EQ(monitor.full_node(kTake), "");
  report(bus, "cap02", 0);
  report(bus, "cap03", 1);
  std::string full;
  EXPECT_TRUE(test::becomes_true([&] { return !(full = monitor.full_node(kTake)).empty(); },
                                 test::within(10)));
  EXPECT_EQ(full, "cap03");
}

TEST(DiskMonitor, ignores_messages_from_before_a_reset) {
  bus::Bus bus(kUrl);
  DiskMonitor monitor(bus, {"cap02"});
  bus::Subscription<wire::HealthMessage> arrived(bus, wire::health_channel("cap02"), 4);
  report(bus, "cap02", 1);
  ASSERT_TRUE(arrived.wait(test::within(10)));
  monitor.reset();
  EXPECT_EQ(monitor.full_node(kTake), "");
}

}  // namespace
}  // namespace v3d::node
