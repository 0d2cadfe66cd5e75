#include <gtest/gtest.h>

#include "daemon/node/node_health.h"
#include "support/child_process.h"
#include "wire/messages.h"

namespace v3d::node {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

void report(bus::Bus& bus, const std::string& node, double full) {
  wire::HealthMessage health;
  health.node = node;
  health.values[kDiskFull] = full;
  bus.publish(wire::health_channel(node), encode(health));
}

TEST(DiskMonitor, finds_the_node_whose_disk_is_full) {
  bus::Bus bus(kUrl);
  DiskMonitor monitor(bus, {"cap02", "cap03"});
  EXPECT_EQ(monitor.full_node(), "");
  report(bus, "cap02", 0);
  report(bus, "cap03", 1);
  std::string full;
  EXPECT_TRUE(
      test::becomes_true([&] { return !(full = monitor.full_node()).empty(); }, test::within(10)));
  EXPECT_EQ(full, "cap03");
}

TEST(DiskMonitor, ignores_messages_from_before_a_reset) {
  bus::Bus bus(kUrl);
  DiskMonitor monitor(bus, {"cap02"});
  bus::Subscription<wire::HealthMessage> arrived(bus, wire::health_channel("cap02"), 4);
  report(bus, "cap02", 1);
  ASSERT_TRUE(arrived.wait(test::within(10)));
  monitor.reset();
  EXPECT_EQ(monitor.full_node(), "");
}

}  // namespace
}  // namespace v3d::node
