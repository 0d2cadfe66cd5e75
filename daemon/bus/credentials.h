// Signs and verifies commands and replies, with the studio key or by the member list.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "base/core/time.h"
#include "daemon/bus/key_rotation.h"
#include "wire/member_list.h"
#include "wire/studio_key.h"

namespace v3d {

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
  void set_studio_key(const StudioKey& key, MonotonicInstant now);
  /// Erases the previous studio key when its grace time is over.
  void discard_old_key(MonotonicInstant now);

  /// To be called before anything is received.
  void require_members();
  /// Replaces the list. Messages of members that are not in it are rejected from now on.
  void set_members(std::shared_ptr<const MemberList> members);
  /// Sets the key that signs when members are required.
  void set_signing_key(const SigningKey& key);

  /// Whether commands can be accepted and answered: there is a studio key and, where members are
  /// required, their list and a key to sign with.
  bool is_complete() const;

  /// Appends a MAC or signature to an encoded command or reply. Requires is_complete().
  Bytes authenticate(Bytes message, MonotonicInstant now) const;
  /// Verifies a command. Decodes nothing.
  OpenedCommand open_command(std::span<const uint8_t> bytes, MonotonicInstant now) const;
  /// Verifies and decodes a reply; empty when it is not authentic or malformed.
  std::optional<ReplyMessage> open_reply(std::span<const uint8_t> bytes,
                                         MonotonicInstant now) const;

 private:
  bool has_mac(std::span<const uint8_t> message, MonotonicInstant now) const;
  std::shared_ptr<const MemberList> members() const;

  mutable std::mutex mutex_;  ///< guards the members below
  KeyRotation<StudioKey> studio_keys_;
  bool requires_members_ = false;
  std::shared_ptr<const MemberList> members_;
  std::optional<SigningKey> signing_key_;
};

}  // namespace v3d
