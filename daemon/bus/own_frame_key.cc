#include "daemon/bus/own_frame_key.h"

#include <algorithm>
#include <utility>

#include "base/core/check.h"
#include "wire/frame_key.h"

namespace v3d {
namespace {

/// The keys of all reconstruction nodes, sorted. Nodes of one PC may share a key.
std::vector<PublicKey> reconstruction_keys(const MemberList& members) {
  std::vector<PublicKey> keys;
  for (const Member& member : members.members) {
    if (member.role == Role::kReconstruction) keys.push_back(member.key);
  }
  std::ranges::sort(keys, {}, &PublicKey::bytes);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

std::vector<SealedFrameKey> seal(const FrameKey& key, const std::vector<PublicKey>& recipients) {
  std::vector<SealedFrameKey> sealed;
  for (const PublicKey& recipient : recipients) {
    if (sealed.size() == kMaxFrameKeyRecipients) break;
    if (const auto one = key.seal_for(recipient)) sealed.push_back(*one);
  }
  return sealed;
}

}  // namespace

bool OwnFrameKey::adapt_to(const MemberList& members, MonotonicInstant now) {
  std::vector<PublicKey> recipients = reconstruction_keys(members);
  const bool is_complete = recipients.size() <= kMaxFrameKeyRecipients;
  const std::lock_guard lock(mutex_);
  keys_.discard_old(now);
  if (keys_.has_key() && recipients == recipients_) return is_complete;
  const FrameKey key = FrameKey::make();
  sealed_ = seal(key, recipients);
  recipients_ = std::move(recipients);
  keys_.set(std::make_shared<Sending>(key.mac()), now);
  return is_complete;
}

FrameKeyMessage OwnFrameKey::announcement() const {
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

}  // namespace v3d
