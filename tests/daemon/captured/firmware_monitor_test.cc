// FirmwareMonitor on a real network.
#include <gtest/gtest.h>

#include "daemon/captured/camera_monitor.h"
#include "support/child_process.h"

namespace v3d::captured {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

wire::HealthMessage health_of(const std::string& node, const std::string& camera,
                              const std::string& firmware) {
  wire::HealthMessage health;
  health.node = node;
  health.texts = {{camera + ".model", "Maker A"}, {camera + ".firmware", firmware}};
  return health;
}

TEST(FirmwareMonitor, compares_the_cameras_of_this_node_with_those_of_the_others) {
  bus::Bus bus(kUrl);
  FirmwareMonitor monitor(bus, {"cap02"});
  const wire::HealthMessage own = health_of("cap01", "cam01", "1.2");
  EXPECT_EQ(monitor.differences(own), "") << "nothing was received";
  bus::Bus other(kUrl);
  EXPECT_TRUE(test::becomes_true(
      [&] {
        other.publish(wire::health_channel("cap02"), encode(health_of("cap02", "cam02", "1.1")));
        return monitor.differences(own) == "Maker A: firmware 1.1 on cam02, 1.2 on cam01";
      },
      test::within(30)));
  EXPECT_TRUE(test::becomes_true(
      [&] {
        other.publish(wire::health_channel("cap02"), encode(health_of("cap02", "cam02", "1.2")));
        return monitor.differences(own).empty();
      },
      test::within(30)))
      << "the camera was updated";
}

}  // namespace
}  // namespace v3d::captured
