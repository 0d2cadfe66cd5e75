#include "trigger/action_acknowledgements.h"

#include <arpa/inet.h>

#include <algorithm>

#include "base/core/error.h"

namespace v3d::trigger {
namespace {

/// Queue length: where no one reads the sensed pulses, the oldest are discarded.
constexpr size_t kMaxPulses = 65'536;

uint32_t ipv4_of(const ActionCamera& camera) {
  in_addr address{};
  if (inet_pton(AF_INET, camera.address.c_str(), &address) == 1) return ntohl(address.s_addr);
  throw InputError("action trigger: camera " + camera.name + ": '" + camera.address +
                   "' is not an IPv4 address");
}

void add(std::string& list, const std::string& name) { list += (list.empty() ? "" : ", ") + name; }

}  // namespace

ActionAcknowledgements::ActionAcknowledgements(std::vector<ActionCamera> cameras) {
  for (ActionCamera& camera : cameras) {
    cameras_.push_back({.name = camera.name, .address = ipv4_of(camera)});
  }
}

void ActionAcknowledgements::reset() {
  const std::lock_guard lock(mutex_);
  for (Camera& camera : cameras_) {
    camera = {.name = std::move(camera.name), .address = camera.address};
  }
  commands_.clear();
  ready_.clear();
  counts_ = {};
}

void ActionAcknowledgements::sent(int64_t number, uint16_t request, MonotonicInstant at) {
  {
    const std::lock_guard lock(mutex_);
    commands_.push_back({.number = number,
                         .request = request,
                         .at = at,
                         .answered = std::vector<bool>(cameras_.size())});
  }
  changed_.notify_all();
}

void ActionAcknowledgements::received(uint32_t address,
                                      const io::ActionAcknowledgement& acknowledgement,
                                      MonotonicInstant now) {
  {
    const std::lock_guard lock(mutex_);
    advance(now);
    const auto camera = std::ranges::find(cameras_, address, &Camera::address);
    const auto command = std::ranges::find(commands_, acknowledgement.request, &Command::request);
    if (camera == cameras_.end()) {
      ++counts_.foreign;
      return;
    }
    if (command == commands_.end()) {
      ++counts_.late;
      return;
    }
    const auto index = static_cast<size_t>(camera - cameras_.begin());
    if (command->answered[index]) {
      ++counts_.repeated;
      return;
    }
    command->answered[index] = true;
    if (acknowledgement.status == io::ActionStatus::kSuccess) {
      ++counts_.acknowledged;
      command->sensed = true;
    } else {
      ++counts_.rejected;
      ++camera->rejected;
      camera->last_rejection = acknowledgement.status;
    }
  }
  changed_.notify_all();
}

void ActionAcknowledgements::expire(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  advance(now);
}

void ActionAcknowledgements::advance(MonotonicInstant now) {
  for (Command& command : commands_) {
    if (command.is_reported) continue;
    const bool is_over = now >= command.at + kDeadline;
    if (now < command.at || (!command.sensed && !is_over)) break;
    command.is_reported = true;
    if (!command.sensed) continue;
    if (ready_.size() >= kMaxPulses) ready_.pop_front();
    ready_.push_back({.number = command.number, .at = command.at, .is_numbered = true});
  }
  while (!commands_.empty() && now >= commands_.front().at + kDeadline) {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (commands_.front().answered[i]) continue;
      ++cameras_[i].missing;
      ++counts_.missing;
    }
    commands_.pop_front();
  }
}

MonotonicInstant ActionAcknowledgements::next_change(MonotonicInstant deadline) const {
  const auto first = std::ranges::find(commands_, false, &Command::is_reported);
  if (first == commands_.end()) return deadline;
  return std::min(deadline, first->sensed ? first->at : first->at + kDeadline);
}

std::optional<SensedPulse> ActionAcknowledgements::wait(MonotonicInstant deadline) {
  std::unique_lock lock(mutex_);
  for (;;) {
    const MonotonicInstant now = Monotonic::now();
    advance(now);
    if (!ready_.empty()) {
      const SensedPulse pulse = ready_.front();
      ready_.pop_front();
      return pulse;
    }
    if (now >= deadline) return std::nullopt;
    changed_.wait_for(lock, next_change(deadline) - now);
  }
}

AcknowledgementCounts ActionAcknowledgements::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string ActionAcknowledgements::warning() const {
  const std::lock_guard lock(mutex_);
  std::string missing;
  std::string rejected;
  for (const Camera& camera : cameras_) {
    if (camera.missing > 0) add(missing, camera.name);
    if (camera.rejected > 0) {
      add(rejected, camera.name + " (" + io::text_of(camera.last_rejection) + ")");
    }
  }
  std::string text;
  if (!missing.empty()) {
    text = std::to_string(counts_.missing) +
           " acknowledgements of action commands missing: " + missing;
  }
  if (!rejected.empty()) {
    text += (text.empty() ? "" : "; ") + std::to_string(counts_.rejected) +
            " action commands rejected: " + rejected;
  }
  return text;
}

}  // namespace v3d::trigger
