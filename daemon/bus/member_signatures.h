// Signatures of members on the messages of the bus: of health, pulses, events, previews, meshes,
// shard messages and answers of sessions. Commands and replies: daemon/bus/credentials.h.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "daemon/bus/channel_list.h"
#include "wire/member_list.h"

namespace v3d {

/// Who may sign a message.
struct AuthorRule {
  ChannelKind::Author author = ChannelKind::Author::kAnyMember;
  std::string_view node;  ///< where `author` is one node: its name; empty: it is not known

  bool permits(const Member& member) const;
  /// "only cap01", for a person.
  std::string text() const;
};
/// `owner`: ChannelList::owner_of(). `inside`: the node that the message names.
AuthorRule rule_of(const ChannelKind& kind, std::string_view owner, std::string_view inside);

/// What verify() found.
struct VerifiedMessage {
  std::string problem;               ///< one line: why the message is rejected; else empty
  std::span<const uint8_t> message;  ///< without its signature
  Signer signer{};
};

/// Without require(), nothing is signed and nothing verified. With it, a message needs the
/// signature of a member that its AuthorRule permits. Before there is a list, every message is
/// rejected; a new list is in force at once. Any thread.
class MemberSignatures {
 public:
  /// To be called before anything is sent or received.
  void require();
  bool are_required() const;
  void set_members(std::shared_ptr<const MemberList> members);
  void set_signing_key(const SigningKey& key);

  /// To sign a message on `channel` with; empty where it carries no signature, or as long as there
  /// is no key: receivers reject what is sent then.
  std::optional<SigningKey> key_for(std::string_view channel) const;

  /// Whether the list has this key. Verifies nothing.
  bool knows(const KeyId& key) const;
  /// Costs one signature and, for a key of the list, one hash of the message.
  VerifiedMessage verify(std::span<const uint8_t> bytes, const MessageOrigin& origin,
                         const ChannelKind& kind, std::string_view owner) const;

 private:
  std::shared_ptr<const MemberList> members() const;

  mutable std::mutex mutex_;  ///< what follows
  bool are_required_ = false;
  std::shared_ptr<const MemberList> members_;
  std::optional<SigningKey> signing_key_;
};

}  // namespace v3d
