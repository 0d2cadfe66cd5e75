#include "daemon/bus/frame_sessions.h"

#include <algorithm>

namespace v3d {

uint32_t FrameSessions::announce(std::string_view node, uint32_t number, const KeyId& signer,
                                 MonotonicInstant now, const OpenKey& open) {
  remove_invalid(now);
  FrameSession& session = find_or_add(node, number);
  session.signer = signer;
  session.announced = now;
  if (session.mac == nullptr) session.mac = open();
  const uint32_t id = session.id;
  if (!session.is_newest) make_newest(id, node, now);
  return id;
}

std::span<const FrameSession> FrameSessions::find(uint32_t number) const {
  const auto first = std::ranges::lower_bound(sessions_, number, {}, &FrameSession::number);
  const auto last = std::ranges::upper_bound(sessions_, number, {}, &FrameSession::number);
  return {first, last};
}

bool FrameSessions::has(uint32_t number, MonotonicInstant now) const {
  return std::ranges::any_of(find(number), [&](const FrameSession& s) { return s.is_valid(now); });
}

FrameSession& FrameSessions::find_or_add(std::string_view node, uint32_t number) {
  for (FrameSession& session : sessions_) {
    if (session.number == number && session.node == node) return session;
  }
  if (sessions_.size() == kMaxSessions) {
    sessions_.erase(std::ranges::min_element(sessions_, {}, &FrameSession::announced));
  }
  const auto place = std::ranges::upper_bound(sessions_, number, {}, &FrameSession::number);
  FrameSession& added = *sessions_.emplace(place);
  added.number = number;
  added.id = ++last_id_;
  added.node = node;
  return added;
}

/// Makes this session the newest one of its node. The newest one until now becomes the one before
/// it; an earlier one is removed.
void FrameSessions::make_newest(uint32_t id, std::string_view node, MonotonicInstant now) {
  std::erase_if(sessions_, [&](const FrameSession& other) {
    return other.node == node && other.id != id && !other.is_newest;
  });
  for (FrameSession& session : sessions_) {
    if (session.node != node) continue;
    if (session.is_newest) session.replaced = now;
    session.is_newest = session.id == id;
  }
}

void FrameSessions::remove_invalid(MonotonicInstant now) {
  std::erase_if(sessions_, [&](const FrameSession& session) { return !session.is_valid(now); });
}

}  // namespace v3d
