#include "daemon/bus/frame_keys.h"

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "wire/datagram_mac.h"

namespace v3d::bus {

uint32_t FrameSessions::announce(std::string_view node, uint32_t number, const wire::KeyId& signer,
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

namespace {

/// The keys of all reconstruction nodes, sorted. Nodes of one PC may share a key.
std::vector<wire::PublicKey> reconstruction_keys(const wire::MemberList& members) {
  std::vector<wire::PublicKey> keys;
  for (const wire::Member& member : members.members) {
    if (member.role == wire::Role::kReconstruction) keys.push_back(member.key);
  }
  std::ranges::sort(keys, {}, &wire::PublicKey::bytes);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

std::vector<wire::SealedFrameKey> seal(const wire::FrameKey& key,
                                       const std::vector<wire::PublicKey>& recipients) {
  std::vector<wire::SealedFrameKey> sealed;
  for (const wire::PublicKey& recipient : recipients) {
    if (sealed.size() == wire::kMaxFrameKeyRecipients) break;
    if (const auto one = key.seal_for(recipient)) sealed.push_back(*one);
  }
  return sealed;
}

}  // namespace

bool OwnFrameKey::adapt_to(const wire::MemberList& members, MonotonicInstant now) {
  std::vector<wire::PublicKey> recipients = reconstruction_keys(members);
  const bool is_complete = recipients.size() <= wire::kMaxFrameKeyRecipients;
  const std::lock_guard lock(mutex_);
  keys_.discard_old(now);
  if (keys_.has_key() && recipients == recipients_) return is_complete;
  const wire::FrameKey key = wire::FrameKey::make();
  sealed_ = seal(key, recipients);
  recipients_ = std::move(recipients);
  keys_.set(std::make_shared<Sending>(key.mac()), now);
  return is_complete;
}

wire::FrameKeyMessage OwnFrameKey::announcement() const {
  const std::lock_guard lock(mutex_);
  V3D_CHECK(keys_.has_key());
  const SendingSession& session = (*keys_.newest())->session;
  return {.sent = {}, .session = session.number(), .newest = session.newest(), .keys = sealed_};
}

std::shared_ptr<OwnFrameKey::Sending> OwnFrameKey::sending(MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  const auto* const key = keys_.sending(now);
  return key ? *key : nullptr;
}

}  // namespace v3d::bus
