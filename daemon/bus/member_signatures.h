// Signatures of members on bus messages: health, pulses, events, previews, meshes, shard messages
// and answers of sessions. For commands and replies see daemon/bus/credentials.h.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "daemon/bus/channel_list.h"
#include "wire/frame_key.h"
#include "wire/member_list.h"

namespace v3d {

/// The members that may sign a message.
struct AuthorRule {
  ChannelKind::Author author = ChannelKind::Author::kAnyMember;
  std::string_view node;  ///< name of the node when `author` is one node; empty when unknown

  bool permits(const Member& member) const;
  /// For messages to the operator, for example "only cap01".
  std::string text() const;
};
/// `owner`: the result of ChannelList::owner_of(). `inside`: the node that the message names.
AuthorRule rule_of(const ChannelKind& kind, std::string_view owner, std::string_view inside);

/// The result of MemberSignatures::verify().
struct VerifiedMessage {
  std::string problem;               ///< one line, when the message is rejected; otherwise empty
  std::span<const uint8_t> message;  ///< without its signature
  Signer signer{};
};

/// Signs and verifies bus messages by the member list. Without require(), messages are neither
/// signed nor verified. After it, a message needs the signature of a member that its AuthorRule
/// permits. Before set_members(), every message is rejected; a new list is in force at once. Any
/// thread.
class MemberSignatures {
 public:
  /// To be called before the first message is sent or received.
  void require();
  bool are_required() const;
  void set_members(std::shared_ptr<const MemberList> members);
  void set_signing_key(const SigningKey& key);

  /// The key that signs a message on `channel`. Empty when messages of the channel are unsigned, or
  /// before set_signing_key(); receivers reject messages that are sent then.
  std::optional<SigningKey> key_for(std::string_view channel) const;

  /// The list in force; null before set_members().
  std::shared_ptr<const MemberList> list() const;
  /// Whether the list contains this key. Verifies no signature.
  bool knows(const KeyId& key) const;
  /// Whether the list has a node of this name with this key. Allocates nothing.
  bool has_node(std::string_view node, const KeyId& key) const;
  /// The frame key that is sealed for the signing key of this process; empty when there is none.
  std::optional<FrameKey> open(const FrameKeyMessage& message) const;
  /// Verifies the signature and the author. Hashes the message and verifies one signature only when
  /// the list contains the key.
  VerifiedMessage verify(std::span<const uint8_t> bytes, const MessageOrigin& origin,
                         const ChannelKind& kind, std::string_view owner) const;

 private:
  mutable std::mutex mutex_;  ///< guards the members below
  bool are_required_ = false;
  std::shared_ptr<const MemberList> members_;
  std::optional<SigningKey> signing_key_;
};

}  // namespace v3d
