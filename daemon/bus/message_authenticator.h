// Message authentication of a process: studio key, signatures of members, counts of rejected
// messages.
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
  void set_key(const StudioKey& key, MonotonicInstant now = Monotonic::now());
  /// Erases the previous key when its grace time is over.
  void discard_old_key(MonotonicInstant now);
  /// Rejects every message while there is no key.
  void require_authentication() { insists_ = true; }
  MemberSignatures& members() { return members_; }
  const MemberSignatures& members() const { return members_; }

  /// The MAC for sending; null when there is no key.
  std::shared_ptr<const DatagramMac> mac(MonotonicInstant now = Monotonic::now()) const;
  /// Whether the trailer's tag is correct for a valid key. While an old key is valid, a wrong tag
  /// costs two hashes of the bytes instead of one. Allocates nothing.
  bool verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
              const MacTrailer& trailer, MonotonicInstant now) const;
  /// Whether messages must be authenticated.
  bool is_required() const { return has_key_ || insists_; }

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
  std::string trouble(RealtimeInstant now) const;

 private:
  MemberSignatures members_;
  std::atomic<bool> has_key_ = false;
  std::atomic<bool> insists_ = false;
  std::atomic<int64_t> forged_ = 0;
  std::atomic<int64_t> unkeyed_ = 0;
  std::atomic<int64_t> not_signed_ = 0;
  std::atomic<int64_t> stale_ = 0;
  std::atomic<int64_t> replayed_ = 0;
  mutable std::mutex mutex_;  ///< guards the members below
  KeyRotation<std::shared_ptr<const DatagramMac>> macs_;
  std::string trouble_;
  RealtimeInstant reported_at_;
};

}  // namespace v3d
