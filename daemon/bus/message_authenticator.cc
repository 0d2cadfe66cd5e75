#include "daemon/bus/message_authenticator.h"

#include <algorithm>
#include <utility>

#include "base/core/text.h"
#include "wire/codec.h"
#include "wire/secret_keys.h"

namespace v3d::bus {
namespace {

/// Time for which health shows the last rejection.
constexpr Duration kShownFor = std::chrono::seconds(10);

}  // namespace

void MessageAuthenticator::set_key(const wire::StudioKey& key, MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  macs_.set(std::make_shared<const wire::DatagramMac>(key), now);
  has_key_ = true;
}

void MessageAuthenticator::discard_old_key(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  macs_.discard_old(now);
}

std::shared_ptr<const wire::DatagramMac> MessageAuthenticator::mac(MonotonicInstant now) const {
  if (!has_key_) return nullptr;
  const std::lock_guard lock(mutex_);
  return *macs_.sending(now);
}

bool MessageAuthenticator::verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
                                  const wire::MacTrailer& trailer, MonotonicInstant now) const {
  if (!has_key_) return false;
  std::shared_ptr<const wire::DatagramMac> newest, old;
  {
    const std::lock_guard lock(mutex_);
    newest = *macs_.newest();
    if (const auto* const mac = macs_.old(now)) old = *mac;
  }
  return newest->verify(head, data, trailer) || (old && old->verify(head, data, trailer));
}

void MessageAuthenticator::count_unverified() {
  if (!has_key_) {
    ++unkeyed_;
    return;
  }
  ++forged_;
  report(
      "messages without the MAC of the studio key are rejected: an attacker, or another studio "
      "key");
}

void MessageAuthenticator::count_forged_frame() {
  ++forged_;
  report("live frames without the MAC of their frame key are rejected: an attacker");
}

void MessageAuthenticator::count_unsigned(std::string_view problem) {
  ++not_signed_;
  report(problem);
}

RejectionCounts MessageAuthenticator::counts() const {
  return {.forged = forged_,
          .unkeyed = unkeyed_,
          .not_signed = not_signed_,
          .stale = stale_,
          .replayed = replayed_};
}

std::string MessageAuthenticator::trouble(MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  return reported_at_ && now - *reported_at_ < kShownFor ? trouble_ : "";
}

void MessageAuthenticator::report(std::string_view trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  reported_at_ = Monotonic::now();
}

namespace {

using enum ChannelKind::Author;

/// Limit for names of nodes in messages to the operator; names in the studio file are shorter.
constexpr size_t kMaxShownName = 64;

/// The sending node that the message names; empty when its kind names none.
std::string node_inside(std::span<const uint8_t> message, const ChannelKind& kind) {
  if (kind.author != kNodeInside) return "";
  const auto event = wire::decode<wire::EventMessage>(message);
  return event ? event->node : "";
}

std::string names_of(const std::vector<const wire::Member*>& members) {
  std::string names;
  for (const wire::Member* member : members) {
    names += (names.empty() ? "" : " or ") + member->name;
  }
  return names;
}

std::string rejected(std::string_view channel, const std::string& why, const AuthorRule& rule) {
  return std::string(channel) + " " + why + " is rejected: " + rule.text() + " may send it";
}

}  // namespace

// --- rules --------------------------------------------------------------------------------------

AuthorRule rule_of(const ChannelKind& kind, std::string_view owner, std::string_view inside) {
  return {.author = kind.author, .node = kind.author == kNodeInside ? inside : owner};
}

bool AuthorRule::permits(const wire::Member& member) const {
  switch (author) {
    case kUnsigned:
      return false;
    case kAnyMember:
      return true;
    case kReconstruction:
      return member.role == wire::Role::kReconstruction;
    case kReconstructionOwner:
      return member.role == wire::Role::kReconstruction && member.name == node;
    case kOwner:
    case kNodeInside:
      return member.is_node() && member.name == node;
  }
  return false;
}

std::string AuthorRule::text() const {
  if (author == kAnyMember) return "only a member";
  if (author == kReconstruction) return "only a node with the role reconstruction";
  const std::string role = author == kReconstructionOwner ? " with the role reconstruction" : "";
  return "only " + printable(node.substr(0, kMaxShownName)) + role;
}

// --- signing and verifying ----------------------------------------------------------------------

void MemberSignatures::require() {
  const std::lock_guard lock(mutex_);
  are_required_ = true;
}

bool MemberSignatures::are_required() const {
  const std::lock_guard lock(mutex_);
  return are_required_;
}

void MemberSignatures::set_members(std::shared_ptr<const wire::MemberList> members) {
  const std::lock_guard lock(mutex_);
  members_ = std::move(members);
}

void MemberSignatures::set_signing_key(const wire::SigningKey& key) {
  const std::lock_guard lock(mutex_);
  signing_key_ = key;
}

std::optional<wire::SigningKey> MemberSignatures::key_for(std::string_view channel) const {
  const ChannelKind* const kind = kind_of(channel);
  if (kind == nullptr || !kind->is_signed()) return std::nullopt;
  const std::lock_guard lock(mutex_);
  return are_required_ ? signing_key_ : std::nullopt;
}

std::shared_ptr<const wire::MemberList> MemberSignatures::list() const {
  const std::lock_guard lock(mutex_);
  return members_;
}

bool MemberSignatures::contains(const wire::KeyId& key) const {
  const auto known = list();
  const auto is_of = [&](const wire::Member& member) { return id_of(member.key) == key; };
  return known && std::ranges::any_of(known->members, is_of);
}

bool MemberSignatures::has_node(std::string_view node, const wire::KeyId& key) const {
  const auto known = list();
  const auto is_of = [&](const wire::Member& member) {
    return member.is_node() && member.name == node && id_of(member.key) == key;
  };
  return known && std::ranges::any_of(known->members, is_of);
}

std::optional<wire::FrameKey> MemberSignatures::open(const wire::FrameKeyMessage& message) const {
  std::optional<wire::SigningKey> own;
  {
    const std::lock_guard lock(mutex_);
    own = signing_key_;
  }
  if (!own) return std::nullopt;
  const auto sealed =
      std::ranges::find(message.keys, id_of(own->public_key()), &wire::SealedFrameKey::recipient);
  return sealed == message.keys.end() ? std::nullopt : wire::FrameKey::open(*sealed, *own);
}

VerifiedMessage MemberSignatures::verify(std::span<const uint8_t> bytes,
                                         const wire::MessageOrigin& origin, const ChannelKind& kind,
                                         std::string_view owner) const {
  const auto signed_message = wire::split_signature(bytes);
  VerifiedMessage verified{.problem = {}, .message = bytes};
  if (signed_message) verified.message = signed_message->message;
  const std::string inside = node_inside(verified.message, kind);
  const AuthorRule rule = rule_of(kind, owner, inside);
  const auto reject = [&](const std::string& why) {
    verified.problem = rejected(origin.channel, why, rule);
    return verified;
  };
  if (!signed_message) return reject("without a member's signature");
  if (!contains(signed_message->key_id)) {
    const std::string key = wire::hexadecimal(signed_message->key_id);
    return reject("signed with key " + key + "..., which the member list here does not have,");
  }
  const auto members = list();
  const auto signers = members->signers_of(*signed_message, origin);
  if (signers.empty()) return reject("with a wrong signature");
  const auto is_permitted = [&](const wire::Member* member) { return rule.permits(*member); };
  if (std::ranges::none_of(signers, is_permitted)) return reject("of member " + names_of(signers));
  verified.signer = signed_message->key_id;
  return verified;
}

}  // namespace v3d::bus
