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

/// A command as it was received, verified.
struct OpenedCommand {
  enum class Result : uint8_t {
    kAccepted,
    kForged,       ///< by no member, or without the MAC of the studio key, or changed since
    kUnauthorized  ///< by a member that is no operator
  } result = Result::kForged;
  std::span<const uint8_t> message;  ///< without its signature; a part of the received bytes
  std::string signer;                ///< the member, where there is a member list
};

/// Without a member list, commands and replies carry a MAC of the studio key: each of its holders
/// may command, and reply for any node.
///
/// With require_members() they carry the Ed25519 signature of a member: a command that of an
/// operator, a reply that of the node which it names. Before there is a list, nothing is accepted.
/// Any thread.
class Credentials {
 public:
  /// Replaces the studio key; the one before it stays valid as KeyRotation says.
  void set_studio_key(const StudioKey& key, MonotonicInstant now);
  /// Wipes a studio key whose time is over.
  void forget_old_key(MonotonicInstant now);

  /// To be called before anything is received.
  void require_members();
  /// Replaces the list. Messages of members that it lacks are rejected from now on.
  void set_members(std::shared_ptr<const MemberList> members);
  /// The key to sign with, where members are required.
  void set_signing_key(const SigningKey& key);

  /// Whether commands can be accepted and answered: there is a studio key and, where members are
  /// required, their list and a key to sign with.
  bool is_complete() const;

  /// The encoded command or reply with its MAC or signature. Requires is_complete().
  Bytes seal(Bytes message, MonotonicInstant now) const;
  OpenedCommand open_command(std::span<const uint8_t> bytes, MonotonicInstant now) const;
  /// Empty when the reply is not authentic, or malformed.
  std::optional<ReplyMessage> open_reply(std::span<const uint8_t> bytes,
                                         MonotonicInstant now) const;

 private:
  bool has_mac(std::span<const uint8_t> message, MonotonicInstant now) const;
  std::shared_ptr<const MemberList> members() const;

  mutable std::mutex mutex_;  ///< what follows
  KeyRotation<StudioKey> studio_keys_;
  bool requires_members_ = false;
  std::shared_ptr<const MemberList> members_;
  std::optional<SigningKey> signing_key_;
};

}  // namespace v3d
