#include "daemon/bus/credentials.h"

#include <algorithm>
#include <utility>

#include "base/core/error.h"

namespace v3d::bus {
namespace {

OpenedCommand open_signed_command(std::span<const uint8_t> bytes, const wire::MemberList& members) {
  OpenedCommand opened;
  const auto signed_message = wire::split_signature(bytes);
  if (!signed_message) return opened;
  const auto signers = members.signers_of(*signed_message);
  if (signers.empty()) return opened;
  const auto found = std::ranges::find(signers, wire::Role::kOperator, &wire::Member::role);
  const bool may_command = found != signers.end();
  opened.result =
      may_command ? OpenedCommand::Result::kAccepted : OpenedCommand::Result::kUnauthorized;
  opened.message = signed_message->message;
  opened.signer = (may_command ? *found : signers.front())->name;
  return opened;
}

std::optional<wire::ReplyMessage> open_signed_reply(std::span<const uint8_t> bytes,
                                                    const wire::MemberList& members) {
  const auto signed_message = wire::split_signature(bytes);
  if (!signed_message) return std::nullopt;
  const auto signers = members.signers_of(*signed_message);
  if (signers.empty()) return std::nullopt;
  auto reply = wire::decode<wire::ReplyMessage>(signed_message->message);
  const auto is_author = [&](const wire::Member* m) {
    return m->is_node() && m->name == reply->node;
  };
  if (!reply || std::ranges::none_of(signers, is_author)) return std::nullopt;
  return reply;
}

}  // namespace

void Credentials::set_studio_key(const wire::StudioKey& key, MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  studio_keys_.set(key, now);
}

void Credentials::discard_old_key(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  studio_keys_.discard_old(now);
}

void Credentials::require_members() {
  const std::lock_guard lock(mutex_);
  requires_members_ = true;
}

void Credentials::set_members(std::shared_ptr<const wire::MemberList> members) {
  const std::lock_guard lock(mutex_);
  members_ = std::move(members);
}

void Credentials::set_signing_key(const wire::SigningKey& key) {
  const std::lock_guard lock(mutex_);
  signing_key_ = key;
}

bool Credentials::is_complete() const {
  const std::lock_guard lock(mutex_);
  return studio_keys_.has_key() && (!requires_members_ || (members_ && signing_key_));
}

wire::Bytes Credentials::authenticate(wire::Bytes message, MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  if (requires_members_) {
    V3D_CHECK(signing_key_.has_value());
    return sign_message(std::move(message), *signing_key_);
  }
  const wire::StudioKey* const key = studio_keys_.sending(now);
  V3D_CHECK(key != nullptr);
  key->add_mac(message);
  return message;
}

OpenedCommand Credentials::open_command(std::span<const uint8_t> bytes,
                                        MonotonicInstant now) const {
  if (!is_complete()) return {};
  if (const auto list = members()) return open_signed_command(bytes, *list);
  if (!has_mac(bytes, now)) return {};
  return {.result = OpenedCommand::Result::kAccepted, .message = bytes, .signer = {}};
}

std::optional<wire::ReplyMessage> Credentials::open_reply(std::span<const uint8_t> bytes,
                                                          MonotonicInstant now) const {
  if (!is_complete()) return std::nullopt;
  if (const auto list = members()) return open_signed_reply(bytes, *list);
  if (!has_mac(bytes, now)) return std::nullopt;
  return wire::decode<wire::ReplyMessage>(bytes);
}

bool Credentials::has_mac(std::span<const uint8_t> message, MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  const wire::StudioKey* const newest = studio_keys_.newest();
  if (newest != nullptr && newest->has_valid_mac(message)) return true;
  const wire::StudioKey* const old = studio_keys_.old(now);
  return old != nullptr && old->has_valid_mac(message);
}

/// Null unless members are required: set_members() has no effect without require_members().
std::shared_ptr<const wire::MemberList> Credentials::members() const {
  const std::lock_guard lock(mutex_);
  return requires_members_ ? members_ : nullptr;
}

}  // namespace v3d::bus
