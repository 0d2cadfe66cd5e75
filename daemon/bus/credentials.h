// Credentials and rotation of keys.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/core/time.h"
#include "wire/member_list.h"
#include "wire/secret_keys.h"

namespace v3d::bus {

// Replacement of a secret key while the studio runs. The previous key remains valid for a grace
// time.

/// Key files are replaced on one PC after the other. Each process therefore accepts the new key at
/// once, but sends with the old key for kSendOld, until the other PCs have the new key too. It
/// accepts the old key for kAcceptOld, which is twice as long: another PC may have read the new key
/// kSendOld later. No message is lost when all PCs get the new key within kSendOld. A third key
/// within that time invalidates the first key at once.
///
/// All times are arguments. One thread.
template <class Key, int kSendOldSeconds = 10>
class KeyRotation {
 public:
  static constexpr Duration kSendOld = std::chrono::seconds(kSendOldSeconds);
  static constexpr Duration kAcceptOld = 2 * kSendOld;

  /// Replaces the key. The first key is used for sending at once.
  void set(Key key, MonotonicInstant now) {
    old_ = std::exchange(key_, std::move(key));
    since_ = now;
  }
  bool has_key() const { return key_.has_value(); }

  /// The key to send with; null when there is none.
  const Key* sending(MonotonicInstant now) const {
    if (old_ && now - since_ < kSendOld) return &*old_;
    return key_ ? &*key_ : nullptr;
  }
  /// The newest key; null when there is none.
  const Key* newest() const { return key_ ? &*key_ : nullptr; }
  /// The previous key while it is accepted; otherwise null.
  const Key* old(MonotonicInstant now) const {
    return old_ && now - since_ < kAcceptOld ? &*old_ : nullptr;
  }
  /// Destroys the old key when its grace time is over; the destructor of a key erases it.
  void discard_old(MonotonicInstant now) {
    if (old(now) == nullptr) old_.reset();
  }

 private:
  std::optional<Key> key_, old_;
  MonotonicInstant since_;  ///< when `key_` was set
};

// Signs and verifies commands and replies, with the studio key or by the member list.

/// The result of verifying a received command.
struct OpenedCommand {
  enum class Result : uint8_t {
    kAccepted,
    kForged,       ///< no valid MAC or signature of a member, or changed on the way
    kUnauthorized  ///< signed by a member that is not an operator
  } result = Result::kForged;
  std::span<const uint8_t> message;  ///< without its signature; a view into the received bytes
  std::string signer;                ///< name of the member; empty without a member list
};

/// Without a member list, commands and replies carry a MAC of the studio key: every process that
/// has the key may send commands, and replies for any node.
///
/// After require_members() they carry the Ed25519 signature of a member: an operator signs
/// commands, and the node that a reply names signs the reply. Before set_members(), every message
/// is rejected. Any thread.
class Credentials {
 public:
  /// Replaces the studio key. The previous key remains valid for a grace time (KeyRotation).
  void set_studio_key(const wire::StudioKey& key, MonotonicInstant now);
  /// Erases the previous studio key when its grace time is over.
  void discard_old_key(MonotonicInstant now);

  /// To be called before anything is received.
  void require_members();
  /// Replaces the list. Messages of members that are not in it are rejected from now on.
  void set_members(std::shared_ptr<const wire::MemberList> members);
  /// Sets the key that signs when members are required.
  void set_signing_key(const wire::SigningKey& key);

  /// Whether commands can be accepted and answered: there is a studio key and, where members are
  /// required, their list and a key to sign with.
  bool is_complete() const;

  /// Appends a MAC or signature to an encoded command or reply. Requires is_complete().
  wire::Bytes authenticate(wire::Bytes message, MonotonicInstant now) const;
  /// Verifies a command. Decodes nothing.
  OpenedCommand open_command(std::span<const uint8_t> bytes, MonotonicInstant now) const;
  /// Verifies and decodes a reply; empty when it is not authentic or malformed.
  std::optional<wire::ReplyMessage> open_reply(std::span<const uint8_t> bytes,
                                               MonotonicInstant now) const;

 private:
  bool has_mac(std::span<const uint8_t> message, MonotonicInstant now) const;
  std::shared_ptr<const wire::MemberList> members() const;

  mutable std::mutex mutex_;  ///< guards the members below
  KeyRotation<wire::StudioKey> studio_keys_;
  bool requires_members_ = false;
  std::shared_ptr<const wire::MemberList> members_;
  std::optional<wire::SigningKey> signing_key_;
};

}  // namespace v3d::bus
