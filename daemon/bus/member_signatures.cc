#include "daemon/bus/member_signatures.h"

#include <algorithm>
#include <utility>

#include "base/core/printable.h"
#include "wire/codec.h"
#include "wire/hexadecimal.h"

namespace v3d {
namespace {

using enum ChannelKind::Author;

/// Limit for names of nodes in messages to the operator; names in the studio file are shorter.
constexpr size_t kMaxShownName = 64;

/// The sending node that the message names; empty when its kind names none.
std::string node_inside(std::span<const uint8_t> message, const ChannelKind& kind) {
  if (kind.author != kNodeInside) return "";
  const auto event = decode<EventMessage>(message);
  return event ? event->node : "";
}

std::string names_of(const std::vector<const Member*>& members) {
  std::string names;
  for (const Member* member : members) {
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

bool AuthorRule::permits(const Member& member) const {
  switch (author) {
    case kUnsigned:
      return false;
    case kAnyMember:
      return true;
    case kReconstruction:
      return member.role == Role::kReconstruction;
    case kReconstructionOwner:
      return member.role == Role::kReconstruction && member.name == node;
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

void MemberSignatures::set_members(std::shared_ptr<const MemberList> members) {
  const std::lock_guard lock(mutex_);
  members_ = std::move(members);
}

void MemberSignatures::set_signing_key(const SigningKey& key) {
  const std::lock_guard lock(mutex_);
  signing_key_ = key;
}

std::optional<SigningKey> MemberSignatures::key_for(std::string_view channel) const {
  const ChannelKind* const kind = kind_of(channel);
  if (kind == nullptr || !kind->is_signed()) return std::nullopt;
  const std::lock_guard lock(mutex_);
  return are_required_ ? signing_key_ : std::nullopt;
}

std::shared_ptr<const MemberList> MemberSignatures::list() const {
  const std::lock_guard lock(mutex_);
  return members_;
}

bool MemberSignatures::knows(const KeyId& key) const {
  const auto known = list();
  const auto is_of = [&](const Member& member) { return id_of(member.key) == key; };
  return known && std::ranges::any_of(known->members, is_of);
}

bool MemberSignatures::has_node(std::string_view node, const KeyId& key) const {
  const auto known = list();
  const auto is_of = [&](const Member& member) {
    return member.is_node() && member.name == node && id_of(member.key) == key;
  };
  return known && std::ranges::any_of(known->members, is_of);
}

std::optional<FrameKey> MemberSignatures::open(const FrameKeyMessage& message) const {
  std::optional<SigningKey> own;
  {
    const std::lock_guard lock(mutex_);
    own = signing_key_;
  }
  if (!own) return std::nullopt;
  const auto sealed =
      std::ranges::find(message.keys, id_of(own->public_key()), &SealedFrameKey::recipient);
  return sealed == message.keys.end() ? std::nullopt : FrameKey::open(*sealed, *own);
}

VerifiedMessage MemberSignatures::verify(std::span<const uint8_t> bytes,
                                         const MessageOrigin& origin, const ChannelKind& kind,
                                         std::string_view owner) const {
  const auto signed_message = split_signature(bytes);
  VerifiedMessage verified{.problem = {}, .message = bytes};
  if (signed_message) verified.message = signed_message->message;
  const std::string inside = node_inside(verified.message, kind);
  const AuthorRule rule = rule_of(kind, owner, inside);
  const auto reject = [&](const std::string& why) {
    verified.problem = rejected(origin.channel, why, rule);
    return verified;
  };
  if (!signed_message) return reject("without a member's signature");
  if (!knows(signed_message->key_id)) {
    const std::string key = hexadecimal(signed_message->key_id);
    return reject("signed with key " + key + "..., which the member list here does not have,");
  }
  const auto members = list();
  const auto signers = members->signers_of(*signed_message, origin);
  if (signers.empty()) return reject("with a wrong signature");
  const auto is_permitted = [&](const Member* member) { return rule.permits(*member); };
  if (std::ranges::none_of(signers, is_permitted)) return reject("of member " + names_of(signers));
  verified.signer = signed_message->key_id;
  return verified;
}

}  // namespace v3d
