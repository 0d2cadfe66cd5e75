#include "daemon/node/disk_monitor.h"

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kHealthQueue = 8;

}  // namespace

bool reports_full_disk(const HealthMessage& health) {
  const auto full = health.values.find(kDiskFull);
  return full != health.values.end() && full->second > 0;
}

DiskMonitor::DiskMonitor(Bus& bus, const std::vector<std::string>& nodes) {
  for (const std::string& node : nodes) {
    nodes_.push_back({node, std::make_unique<Subscription<HealthMessage>>(bus, health_channel(node),
                                                                          kHealthQueue)});
  }
}

void DiskMonitor::reset() {
  for (const Node& node : nodes_) {
    while (node.health->wait(Monotonic::now())) {
    }
  }
}

std::string DiskMonitor::full_node() {
  for (const Node& node : nodes_) {
    while (const auto health = node.health->wait(Monotonic::now())) {
      if (reports_full_disk(*health)) return node.name;
    }
  }
  return "";
}

}  // namespace v3d
