#include "daemon/captured/firmware_monitor.h"

#include "daemon/control/camera_firmware.h"

namespace v3d::captured {
namespace {

constexpr size_t kQueue = 4;

}  // namespace

FirmwareMonitor::FirmwareMonitor(bus::Bus& bus, const std::vector<std::string>& nodes) {
  for (const std::string& node : nodes) {
    subscriptions_.push_back(std::make_unique<bus::Subscription<wire::HealthMessage>>(
        bus, wire::health_channel(node), kQueue));
  }
}

std::string FirmwareMonitor::differences(const wire::HealthMessage& own) {
  for (const auto& subscription : subscriptions_) {
    while (auto health = subscription->wait(Monotonic::now())) {
      health_[health->node] = std::move(*health);
    }
  }
  health_[own.node] = own;
  return control::firmware_differences(health_);
}

}  // namespace v3d::captured
