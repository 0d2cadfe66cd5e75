#include "daemon/recond/shard_members.h"

#include <iterator>
#include <numeric>

#include "base/core/error.h"

namespace v3d::recond {

size_t owner_of(int64_t pulse, const std::vector<bool>& available) {
  const auto size = static_cast<int64_t>(available.size());
  const auto count = std::count(available.begin(), available.end(), true);
  V3D_CHECK(count > 0);
  const auto slot = static_cast<size_t>(pulse % size);
  if (available[slot]) return slot;
  auto left = (pulse / size) % count;
  size_t index = 0;
  while (!available[index] || left-- > 0) ++index;
  return index;
}

bus::FrameGroupSet groups_of(size_t index, size_t nodes, size_t groups) {
  // Pulses p = index (mod nodes) and p = g (mod groups) exist when the greatest common divisor
  // divides g - index.
  const size_t step = std::gcd(nodes, groups);
  bus::FrameGroupSet found;
  for (size_t group = index % step; group < groups; group += step) found.insert(group);
  return found;
}

ShardMembers::ShardMembers(std::vector<std::string> roster, size_t self, Duration liveness_timeout)
    : roster_(std::move(roster)),
      self_(self),
      liveness_timeout_(liveness_timeout),
      members_(roster_.size()) {}

bool ShardMembers::on_status(const wire::ShardMessage& status, Duration now) {
  const auto found = std::find(roster_.begin(), roster_.end(), status.node);
  if (found == roster_.end()) return false;
  const auto index = static_cast<size_t>(found - roster_.begin());
  Member& member = members_[index];
  // The network may reorder messages. A node that was silent may have restarted with another clock.
  const bool is_old = is_alive(index, now) && status.sent <= member.status.sent;
  if (index == self_ || is_old) return false;
  member.received = now;
  for (const int64_t pulse : status.given_up) {
    if (pulse >= forgotten_) member.given_up.insert(pulse);
  }
  while (member.given_up.size() > kMaxGivenUp) {
    member.given_up.erase(std::prev(member.given_up.end()));
  }
  // A node that takes over an older pulse reports less than before.
  while (!member.done.empty() && member.done.back().first > status.done) member.done.pop_back();
  if (member.done.empty() || member.done.back().first < status.done) {
    member.done.emplace_back(status.done, now);
  }
  if (member.done.size() > kMaxDone) member.done.pop_front();
  member.status = status;
  return true;
}

bool ShardMembers::is_alive(size_t index, Duration now) const {
  const auto& received = members_[index].received;
  return index == self_ || (received && now - *received < liveness_timeout_);
}

size_t ShardMembers::alive_count(Duration now) const {
  size_t count = 0;
  for (size_t index = 0; index < size(); ++index) count += is_alive(index, now);
  return count;
}

bool ShardMembers::is_available(size_t index, int64_t pulse, Duration now) const {
  const int64_t first = members_[index].status.first;
  return first >= 0 && first <= pulse && is_alive(index, now);
}

std::vector<bool> ShardMembers::available_members(int64_t pulse, Duration now) const {
  std::vector<bool> available(size());
  for (size_t index = 0; index < size(); ++index) {
    available[index] = is_available(index, pulse, now);
  }
  if (std::ranges::find(available, true) == available.end()) available[self_] = true;
  return available;
}

size_t ShardMembers::owner(int64_t pulse, Duration now) const {
  return owner_of(pulse, available_members(pulse, now));
}

size_t ShardMembers::publisher(int64_t pulse, Duration now) const {
  const std::vector<bool> available = available_members(pulse, now);
  return static_cast<size_t>(std::ranges::find(available, true) - available.begin());
}

std::optional<Duration> ShardMembers::done_since(size_t index, int64_t pulse) const {
  for (const auto& [last, since] : members_[index].done) {
    if (last >= pulse) return since;
  }
  return std::nullopt;
}

std::optional<Duration> ShardMembers::silent_since(size_t index, Duration now) const {
  const auto& received = members_[index].received;
  if (!received || is_alive(index, now)) return std::nullopt;
  return *received + liveness_timeout_;
}

int ShardMembers::rank(int64_t pulse, Duration now) const {
  const size_t owner = this->owner(pulse, now);
  int rank = 0;
  for (size_t step = 1; (owner + step) % size() != self_ && step < size(); ++step) {
    rank += is_available((owner + step) % size(), pulse, now);
  }
  return rank;
}

void ShardMembers::forget_before(int64_t pulse) {
  forgotten_ = std::max(forgotten_, pulse);
  for (Member& member : members_) {
    member.given_up.erase(member.given_up.begin(), member.given_up.lower_bound(forgotten_));
    auto& done = member.done;
    while (done.size() > 1 && done.front().first < forgotten_) done.pop_front();
  }
}

bool ReorderBuffer::add(wire::MeshMessage mesh) {
  if (has(mesh.pulse)) return false;
  bytes_ += mesh.compact.size();
  const int64_t pulse = mesh.pulse;
  waiting_.emplace(pulse, std::move(mesh));
  return true;
}

std::optional<wire::MeshMessage> ReorderBuffer::pop() {
  const auto found = waiting_.find(next_);
  if (found == waiting_.end()) return std::nullopt;
  std::optional<wire::MeshMessage> mesh(std::move(found->second));
  waiting_.erase(found);
  bytes_ -= mesh->compact.size();
  ++next_;
  return mesh;
}

}  // namespace v3d::recond
