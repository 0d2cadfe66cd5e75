// The studio key and the members' signatures of a process, and the account of what was rejected.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>

#include "base/core/time.h"
#include "daemon/bus/key_rotation.h"
#include "daemon/bus/member_signatures.h"
#include "wire/datagram_mac.h"

namespace v3d {

/// What was rejected, by cause.
struct SealCounts {
  int64_t forged = 0;      ///< datagrams without the studio's MAC, or changed since
  int64_t unkeyed = 0;     ///< datagrams that came while there was no key here to verify them with
  int64_t not_signed = 0;  ///< messages without the signature of a member that may send them
  int64_t stale = 0;       ///< authentic, and in doubt whether they are recent (SessionGate)
  int64_t replayed = 0;    ///< received before; a network that repeats does that, too
};

/// With a key, what is sent carries a MAC in each datagram (wire/datagram_mac.h), and only what
/// carries one is accepted. Without a key nothing carries one, and every message is accepted,
/// unless a daemon has called insist(): `v3dctl watch` without a key only shows. Any thread.
class MessageSeal {
 public:
  /// Replaces the key; the one before it stays valid as KeyRotation says.
  void set_key(const StudioKey& key, MonotonicInstant now = Monotonic::now());
  /// Wipes a key whose time is over.
  void forget_old_key(MonotonicInstant now);
  /// Nothing is accepted without a key, either.
  void insist() { insists_ = true; }
  /// Commands and replies need the MAC of each datagram too: where members sign them, so that a
  /// stranger's command costs a hash and no signature. To be called before anything is received.
  void cover_commands() { covers_commands_ = true; }
  bool covers_commands() const { return covers_commands_; }
  MemberSignatures& members() { return members_; }
  const MemberSignatures& members() const { return members_; }

  /// To send with. Null as long as there is no key.
  std::shared_ptr<const DatagramMac> mac(MonotonicInstant now = Monotonic::now()) const;
  /// Whether the tag is that of a valid key. While an old key is valid, a datagram with a wrong tag
  /// costs two hashes of its bytes instead of one. Allocates nothing.
  bool verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
              const MacTrailer& trailer, MonotonicInstant now) const;
  /// Whether messages must be authenticated.
  bool is_required() const { return has_key_ || insists_; }

  /// A datagram that verify() rejected: forged, or unkeyed where there is no key.
  void count_unverified();
  /// A message that MemberSignatures rejected; `problem` is for a person.
  void count_unsigned(std::string_view problem);
  void count_stale() { ++stale_; }
  void count_replayed() { ++replayed_; }
  SealCounts counts() const;
  /// Something was rejected that no count here holds. Allocates nothing after the first time.
  void report(std::string_view trouble);
  /// One line for a person when messages were rejected shortly before `now`, else empty.
  std::string trouble(RealtimeInstant now) const;

 private:
  MemberSignatures members_;
  std::atomic<bool> has_key_ = false;
  std::atomic<bool> insists_ = false;
  std::atomic<bool> covers_commands_ = false;
  std::atomic<int64_t> forged_ = 0;
  std::atomic<int64_t> unkeyed_ = 0;
  std::atomic<int64_t> not_signed_ = 0;
  std::atomic<int64_t> stale_ = 0;
  std::atomic<int64_t> replayed_ = 0;
  mutable std::mutex mutex_;  ///< what follows
  KeyRotation<std::shared_ptr<const DatagramMac>> macs_;
  std::string trouble_;
  RealtimeInstant troubled_;
};

}  // namespace v3d
