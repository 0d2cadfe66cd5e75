// Anti-replay filter: accepts each authentic message once and only when it is recent, by a window
// of sequence numbers and a clock for each sending session.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/core/time.h"
#include "wire/signatures.h"

namespace v3d::bus {

/// Session, number and time of a message, from the trailers of its datagrams. A session is one
/// sending socket.
struct SessionStamp {
  uint32_t session = 0;
  uint32_t sequence = 0;
  RealtimeInstant sent;
};

/// The clocks of the receiver at one time.
struct ReceiverTime {
  MonotonicInstant monotonic;
  RealtimeInstant realtime;
  static ReceiverTime now() { return {Monotonic::now(), Realtime::now()}; }
};

/// Accepts a message once, and only when it is recent.
///
/// Once: messages may be reordered by up to kWindow - 1 numbers; older ones count as received.
///
/// Recent: the times of sending in a session must advance like this PC's CLOCK_MONOTONIC, relative
/// to the message with the shortest delay and within kDrift. A known session therefore needs no
/// synchronized clock, and wall clocks may be set. An unknown session is accepted when its time
/// agrees with this PC's CLOCK_REALTIME. Otherwise the message is not recent until the session has
/// responded to a challenge (SessionChallenges); the response holds a new nonce, so it cannot be a
/// recording. The caller passes it to accept().
///
/// A message that seems old may be late, or its sender's clock was set back. A response decides:
/// the clock was set if the response seems older than its challenge. Without a response, all
/// messages of the session would seem old until kDrift has made up for the step.
///
/// Messages that nodes act on need a response of their session in any case (has_responded()). With
/// a wall clock alone, recordings of that time would be accepted after a restart.
///
/// Where members sign, a session is identified by its number and the key that signs its messages
/// and responses. Every member has the studio key, so it can send and respond with the number of
/// another member's session. It changes only the window and clock of its own key.
///
/// At most kMaxSessions are stored. A new one replaces the session that was silent longest. Then
/// unknown sessions are not recent with messages that were sent before the last one of the removed
/// session. The caller must note authentic messages only, so senders without the key cannot change
/// the state. Allocates nothing after construction. One thread. Source: RFC 6479, with one bit a
/// message.
class SessionReplayFilter {
 public:
  static constexpr uint32_t kWindow = 1024;
  static constexpr size_t kMaxSessions = 256;
  /// The largest age of a recent message; it permits delays in the network.
  static constexpr Duration kOldest = std::chrono::seconds(5);
  /// A message that seems older causes a challenge: it is late, or the clock of its sender was set
  /// back or slewed. Then the times of pulses would be wrong by as much.
  static constexpr Duration kSeemsOld = std::chrono::milliseconds(10);
  /// The largest lead of a sender's clock.
  static constexpr Duration kAhead = std::chrono::seconds(2);
  /// The largest difference in rate of two clocks: crystals deviate by 100 ppm, and the kernel
  /// slews by 500 ppm for NTP. A clock that is slewed faster, as chrony can, counts as set.
  static constexpr double kDrift = 1e-3;

  SessionReplayFilter() { sessions_.reserve(kMaxSessions); }

  /// Whether the message was received before. To be called before the verification of the message.
  /// Sequence numbers may wrap.
  bool is_received(const SessionStamp& stamp, const wire::Signer& signer = {}) const;
  /// Whether the session is stored for any signer: an authentic message of it was accepted, or it
  /// has responded.
  bool contains(uint32_t session) const;
  /// Whether an authentic message is recent. If not, challenge its session (SessionChallenges).
  bool is_recent(const SessionStamp& stamp, const ReceiverTime& now,
                 const wire::Signer& signer = {}) const;
  /// Whether the message is recent for any signer. For fragments, whose signer is not known yet.
  bool is_recent_for_any(const SessionStamp& stamp, const ReceiverTime& now) const;
  /// The least possible time since an authentic message was sent, at least 0; 0 for an unknown
  /// session.
  Duration age(const SessionStamp& stamp, const ReceiverTime& now,
               const wire::Signer& signer = {}) const;
  /// When an authentic message was sent, on this PC's CLOCK_MONOTONIC: late by the delay of the
  /// fastest message until now, and at most `now`; `now` for an unknown session. Unlike age(),
  /// which must never be too large, it assumes that the clocks have not drifted since that message.
  /// Early, by the step, if the sender's clock was set back and the session has not responded
  /// since.
  MonotonicInstant sent_here(const SessionStamp& stamp, const ReceiverTime& now,
                             const wire::Signer& signer = {}) const;
  /// Whether accept() was called for the session and the signer.
  bool has_responded(uint32_t session, const wire::Signer& signer = {}) const;
  /// Records an authentic, recent message as received. With a signer: its signature was verified.
  void note(const SessionStamp& stamp, const ReceiverTime& now, const wire::Signer& signer = {});
  /// Records that the session has responded to a challenge with this signer. `newest.sent` is the
  /// session's current time, `newest.sequence` the number of its last message. After the first
  /// response, messages up to that number count as received.
  ///
  /// `since_challenge`: the time since the challenge was sent first, the largest possible age of
  /// the response. A response that seems older by the comparison of clocks until now, or younger
  /// than all earlier messages, replaces this comparison. Otherwise the comparison stays: the
  /// response is late.
  void accept(const SessionStamp& newest, const ReceiverTime& now, Duration since_challenge,
              const wire::Signer& signer = {});
  /// Number of removed sessions. After a removal, responses to earlier challenges must be ignored:
  /// they may be older than messages that were received.
  int64_t forgotten() const { return forgotten_; }

 private:
  struct Session {
    uint32_t id = 0;
    wire::Signer signer;
    uint32_t newest = 0;
    bool has_responded = false;
    RealtimeInstant newest_sent = RealtimeInstant::min();
    MonotonicInstant received_at;  ///< time of the last reception
    // The message with the shortest delay: times of sending and reception.
    RealtimeInstant fast_sent;
    MonotonicInstant fast_received;
    std::bitset<kWindow> received;  ///< by sequence number modulo kWindow

    /// The delay of a message minus that of the fast one.
    Duration delay(RealtimeInstant sent, MonotonicInstant now) const {
      return (now - fast_received) - (sent - fast_sent);
    }
    Duration drift(MonotonicInstant now) const {
      return from_seconds(kDrift * to_seconds(now - fast_received));
    }
    /// The least possible age of a message.
    Duration age(RealtimeInstant sent, MonotonicInstant now) const {
      return delay(sent, now) - drift(now);
    }
    MonotonicInstant sent_here(RealtimeInstant sent) const {
      return fast_received + (sent - fast_sent);
    }
    bool is_of(uint32_t session, const wire::Signer& other) const {
      return id == session && signer == other;
    }
  };
  const Session* find(uint32_t session, const wire::Signer& signer) const;
  Session& find_or_add(const SessionStamp& stamp, const ReceiverTime& now,
                       const wire::Signer& signer);
  bool agrees_with_wall_clock(RealtimeInstant sent, const ReceiverTime& now) const;

  std::vector<Session> sessions_;
  RealtimeInstant floor_ = RealtimeInstant::min();
  int64_t forgotten_ = 0;
};

/// Pending challenges to sessions, each with its nonce: challenge-response authentication of the
/// time of a session. One thread.
class SessionChallenges {
 public:
  /// Limits: time between two challenges to a session, time for a response, number of pending
  /// challenges.
  static constexpr Duration kResendAfter = std::chrono::milliseconds(200);
  static constexpr Duration kResponseTimeout = std::chrono::seconds(2);
  static constexpr size_t kMaxPending = 16;

  /// The nonce of a challenge to the session; empty when one was sent less than kResendAfter ago.
  /// `signer`: the key that must sign the response; empty: the key of any member.
  std::optional<int64_t> issue(uint32_t session, MonotonicInstant now,
                               const wire::Signer& signer = {});
  /// Whether a response of `signer` with this nonce matches a pending challenge.
  bool is_pending(uint32_t session, int64_t nonce, MonotonicInstant now,
                  const wire::Signer& signer = {}) const;
  /// Removes the pending challenge that this response matches. Returns the time since that
  /// challenge was sent first; empty if the response matches none.
  std::optional<Duration> pop_matching(uint32_t session, int64_t nonce, MonotonicInstant now,
                                       const wire::Signer& signer = {});

 private:
  struct Challenge {
    uint32_t session = 0;
    int64_t nonce = 0;  ///< 0: unused entry
    wire::Signer signer;
    MonotonicInstant first_sent, last_sent;
    bool is_pending(MonotonicInstant now) const {
      return nonce != 0 && now - first_sent < kResponseTimeout;
    }
    bool is_of(const wire::Signer& other) const { return !signer || signer == other; }
  };
  const Challenge* find(uint32_t session, int64_t nonce, MonotonicInstant now,
                        const wire::Signer& signer) const;
  std::array<Challenge, kMaxPending> challenges_;
};

}  // namespace v3d::bus
