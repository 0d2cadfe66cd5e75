#include "daemon/node/name_monitor.h"

#include "wire/channels.h"
#include "wire/studio_key.h"

namespace v3d {
namespace {

constexpr size_t kQueue = 16;

/// 52 bits: exact in a double.
double random_instance() { return static_cast<double>(random_nonce() & ((int64_t{1} << 52) - 1)); }

}  // namespace

NameMonitor::NameMonitor(Bus& bus, std::string node)
    : node_(std::move(node)),
      instance_(random_instance()),
      healths_(bus, health_channel(node_), kQueue) {}

void NameMonitor::mark(HealthMessage& health) const { health.values[kInstance] = instance_; }

void NameMonitor::on_health(const HealthMessage& health, MonotonicInstant now) {
  const auto instance = health.values.find(kInstance);
  const double sender = instance == health.values.end() ? -1 : instance->second;
  if (sender == instance_) return;
  const bool is_same = sender == other_ && last_of_other_ && now - *last_of_other_ <= kAlarmTime;
  messages_of_other_ = is_same ? messages_of_other_ + 1 : 1;
  other_ = sender;
  last_of_other_ = now;
}

std::string NameMonitor::alarm(MonotonicInstant now) {
  while (const auto health = healths_.wait(Monotonic::now())) on_health(*health, now);
  if (messages_of_other_ < 2 || !last_of_other_ || now - *last_of_other_ > kAlarmTime) return "";
  return "another process sends as node " + node_ + ": end one of the two; no take can be armed";
}

}  // namespace v3d
