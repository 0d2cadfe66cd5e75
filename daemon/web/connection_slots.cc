#include "daemon/web/connection_slots.h"

#include <algorithm>

namespace v3d::web {

template <class Matches>
size_t ConnectionSlots::count(Matches matches) const {
  return static_cast<size_t>(std::ranges::count_if(entries_, matches));
}

template <class Matches>
std::optional<ConnectionSlots::Id> ConnectionSlots::remove_unauthenticated(Matches matches) {
  const auto oldest = std::ranges::find_if(entries_, [&](const Entry& entry) {
    return entry.role == ClientRole::kUnauthenticated && matches(entry);
  });
  if (oldest == entries_.end()) return {};
  const Id id = oldest->id;
  entries_.erase(oldest);
  return id;
}

ConnectionSlots::Slot ConnectionSlots::add(const std::string& address, bool is_reserved,
                                           std::optional<Id> replaced) {
  entries_.push_back({.id = ++last_id_, .address = address, .is_reserved = is_reserved});
  return {.id = last_id_, .is_reserved = is_reserved, .replaced = replaced};
}

std::optional<ConnectionSlots::Slot> ConnectionSlots::acquire(const std::string& address) {
  const auto reserved = [](const Entry& entry) { return entry.is_reserved; };
  const auto common = [](const Entry& entry) { return !entry.is_reserved; };
  const auto same = [&](const Entry& entry) {
    return !entry.is_reserved && entry.address == address;
  };
  const bool address_is_full = count(same) >= kMaxPerAddress;
  if (!address_is_full && count(common) < kMaxCommon) return add(address, false, {});
  const auto replaced =
      address_is_full ? remove_unauthenticated(same) : remove_unauthenticated(common);
  if (replaced) return add(address, false, replaced);
  if (count(reserved) < kReserved) return add(address, true, {});
  const auto waiting = remove_unauthenticated(reserved);
  if (!waiting) return {};
  return add(address, true, waiting);
}

void ConnectionSlots::set_role(Id id, ClientRole role) {
  const auto found = std::ranges::find(entries_, id, &Entry::id);
  if (found != entries_.end()) found->role = role;
}

void ConnectionSlots::release(Id id) {
  entries_.remove_if([id](const Entry& entry) { return entry.id == id; });
}

}  // namespace v3d::web
