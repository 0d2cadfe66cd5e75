// Authentication of messages: MACs and signatures of members.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "daemon/bus/channel_list.h"
#include "daemon/bus/credentials.h"
#include "wire/datagram_mac.h"
#include "wire/member_list.h"

namespace v3d::bus {

// Signatures of members on bus messages: health, pulses, events, previews, meshes, shard messages
// and responses of sessions. For commands and replies see daemon/bus/credentials.h.

/// The members that may sign a message.
struct AuthorRule {
  ChannelKind::Author author = ChannelKind::Author::kAnyMember;
  std::string_view node;  ///< name of the node when `author` is one node; empty when unknown

  bool permits(const wire::Member& member) const;
  /// For messages to the operator, for example "only cap01".
  std::string text() const;
};
/// `owner`: the result of ChannelList::owner_of(). `inside`: the node that the message names.
AuthorRule rule_of(const ChannelKind& kind, std::string_view owner, std::string_view inside);

/// The result of MemberSignatures::verify().
struct VerifiedMessage {
  std::string problem;               ///< one line, when the message is rejected; otherwise empty
  std::span<const uint8_t> message;  ///< without its signature
  wire::Signer signer{};
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
  void set_members(std::shared_ptr<const wire::MemberList> members);
  void set_signing_key(const wire::SigningKey& key);

  /// The key that signs a message on `channel`. Empty when messages of the channel are unsigned, or
  /// before set_signing_key(); receivers reject messages that are sent then. Empty without
  /// require(): the key of a node then signs its takes only.
  std::optional<wire::SigningKey> key_for(std::string_view channel) const;

  /// The list in force; null before set_members().
  std::shared_ptr<const wire::MemberList> list() const;
  /// Whether the list contains this key. Verifies no signature.
  bool contains(const wire::KeyId& key) const;
  /// Whether the list has a node of this name with this key. Allocates nothing.
  bool has_node(std::string_view node, const wire::KeyId& key) const;
  /// The frame key that is sealed for the signing key of this process; empty when there is none.
  std::optional<wire::FrameKey> open(const wire::FrameKeyMessage& message) const;
  /// Verifies the signature and the author. Hashes the message and verifies one signature only when
  /// the list contains the key.
  VerifiedMessage verify(std::span<const uint8_t> bytes, const wire::MessageOrigin& origin,
                         const ChannelKind& kind, std::string_view owner) const;

 private:
  mutable std::mutex mutex_;  ///< guards the members below
  bool are_required_ = false;
  std::shared_ptr<const wire::MemberList> members_;
  std::optional<wire::SigningKey> signing_key_;
};

// Message authentication of a process: studio key, signatures of members, counts of rejected
// messages.

/// Rejected datagrams and messages, by cause.
struct RejectionCounts {
  int64_t forged = 0;      ///< datagrams without a valid MAC of the studio key or frame key
  int64_t unkeyed = 0;     ///< datagrams for which this process has no key, or had none yet
  int64_t not_signed = 0;  ///< messages without the signature of a member that may send them
  int64_t stale = 0;       ///< authentic, but not proven to be recent (SessionReplayFilter)
  int64_t replayed = 0;    ///< received before; networks may also duplicate datagrams
};

/// With a key, each sent datagram carries a MAC (wire/datagram_mac.h), and only datagrams with a
/// valid MAC are accepted. Without a key, datagrams carry no MAC and every message is accepted,
/// unless require_authentication() was called. Daemons call it; `v3dctl watch` does not, because it
/// only shows messages. Any thread.
class MessageAuthenticator {
 public:
  /// Replaces the key. The previous key remains valid for a grace time (KeyRotation).
  void set_key(const wire::StudioKey& key, MonotonicInstant now = Monotonic::now());
  /// Erases the previous key when its grace time is over.
  void discard_old_key(MonotonicInstant now);
  /// Rejects every message while there is no key.
  void require_authentication() { is_always_required_ = true; }
  MemberSignatures& members() { return members_; }
  const MemberSignatures& members() const { return members_; }

  /// The MAC for sending; null when there is no key.
  std::shared_ptr<const wire::DatagramMac> mac(MonotonicInstant now = Monotonic::now()) const;
  /// Whether the trailer's tag is correct for a valid key. While an old key is valid, a wrong tag
  /// costs two hashes of the bytes instead of one. Allocates nothing.
  bool verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
              const wire::MacTrailer& trailer, MonotonicInstant now) const;
  /// Whether messages must be authenticated.
  bool is_required() const { return has_key_ || is_always_required_; }

  /// Counts a datagram that verify() rejected: as `forged`, or as `unkeyed` when there is no key.
  void count_unverified();
  /// Counts a datagram of a frame session without the MAC of its key.
  void count_forged_frame();
  /// Counts a live frame that this process has no frame key for.
  void count_unkeyed() { ++unkeyed_; }
  /// Counts a message that MemberSignatures rejected, and reports `problem`.
  void count_unsigned(std::string_view problem);
  void count_stale() { ++stale_; }
  void count_replayed() { ++replayed_; }
  RejectionCounts counts() const;
  /// Sets the text that trouble() returns. Allocates nothing unless the text is longer than all
  /// before.
  void report(std::string_view trouble);
  /// One line for the operator when messages were rejected in the 10 s before `now`; otherwise
  /// empty.
  std::string trouble(MonotonicInstant now) const;

 private:
  MemberSignatures members_;
  std::atomic<bool> has_key_ = false;
  std::atomic<bool> is_always_required_ = false;  ///< also without a key
  std::atomic<int64_t> forged_ = 0;
  std::atomic<int64_t> unkeyed_ = 0;
  std::atomic<int64_t> not_signed_ = 0;
  std::atomic<int64_t> stale_ = 0;
  std::atomic<int64_t> replayed_ = 0;
  mutable std::mutex mutex_;  ///< guards the members below
  KeyRotation<std::shared_ptr<const wire::DatagramMac>> macs_;
  std::string trouble_;
  std::optional<MonotonicInstant> reported_at_;
};

// Set of the tags of datagrams that a receiver has accepted lately, in memory of fixed size.

/// Detects repeated datagrams before their MAC is computed. The tag is the MAC itself. A sender
/// without the key cannot make a datagram with a valid tag of its own; it can only repeat one that
/// was sent. Stores kSets * kWays tags; a new tag replaces the oldest one of its set. Allocates
/// nothing after construction. One thread.
class RecentTags {
 public:
  static constexpr size_t kSets = 2048;
  static constexpr size_t kWays = 4;
  using Tag = decltype(wire::MacTrailer::tag);

  RecentTags() : sets_(kSets) {}

  bool contains(const Tag& tag) const {
    const auto& tags = sets_[index_of(tag)].tags;
    return std::ranges::find(tags, tag) != tags.end();
  }
  void insert(const Tag& tag) {
    Set& set = sets_[index_of(tag)];
    set.tags[set.next] = tag;
    set.next = (set.next + 1) % kWays;
  }

 private:
  struct Set {
    std::array<Tag, kWays> tags{};  ///< zero: unused
    size_t next = 0;
  };
  static size_t index_of(const Tag& tag) { return (size_t{tag[0]} << 8 | tag[1]) % kSets; }

  std::vector<Set> sets_;
};

}  // namespace v3d::bus
