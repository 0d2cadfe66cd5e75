// Which authentic messages are recent, and each once: anti-replay windows and clocks of the sending
// sessions.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/core/time.h"
#include "wire/message_signature.h"

namespace v3d {

/// Of a message, by the trailers of its datagrams. A session is one sending socket.
struct SessionStamp {
  uint32_t session = 0;
  uint32_t sequence = 0;
  RealtimeInstant sent;
};

/// The clocks of the receiver, read together.
struct ReceiverTime {
  MonotonicInstant monotonic;
  RealtimeInstant realtime;
  static ReceiverTime now() { return {Monotonic::now(), Realtime::now()}; }
};

/// A message is accepted once, and when it is recent.
///
/// Once: messages may overtake each other by up to kWindow - 1; older ones count as received.
///
/// Recent: the time of sending advances in a session as this host's CLOCK_MONOTONIC does, but for
/// kDrift, from the message that was fastest. So a known session needs no agreement of clocks, and
/// clocks may be set. A session that is not known is accepted when its time agrees with this host's
/// CLOCK_REALTIME. Where it does not, the message is in doubt: the session is asked
/// (SessionQuestions), and its answer, which nobody can have recorded, is given to accept().
///
/// Messages that nodes act on need more: their session must have answered since it is known here
/// (has_answered()). A wall clock alone would let recordings of its time in after a restart. Where
/// members sign, the answer must be of the key that signs the messages: every member has the studio
/// key, so it can send and answer in a session of another, whose recorded messages it has.
///
/// kMaxSessions are remembered; when there are more, the one that was silent longest is forgotten,
/// and unknown sessions are in doubt with what was sent before its last message. Only authentic
/// messages may be noted, so nobody without the key changes anything here. Allocates nothing after
/// construction. One thread.
/// Source: RFC 6479, with one bit a message.
class SessionGate {
 public:
  static constexpr uint32_t kWindow = 1024;
  static constexpr size_t kMaxSessions = 256;
  /// A message may be so old: networks are slow.
  static constexpr Duration kOldest = std::chrono::seconds(5);
  /// So far may a sender be ahead.
  static constexpr Duration kAhead = std::chrono::seconds(2);
  /// Two clocks differ in rate by no more: crystals are good to 100 ppm, NTP slews by 500.
  static constexpr double kDrift = 1e-3;

  SessionGate() { sessions_.reserve(kMaxSessions); }

  /// Before anything is verified. Sequence numbers wrap.
  bool is_received(const SessionStamp& stamp) const;
  /// Of an authentic message. False: it is in doubt.
  bool is_recent(const SessionStamp& stamp, const ReceiverTime& now) const;
  /// Whether the last accept() for the session was with this signer.
  bool has_answered(uint32_t session, const Signer& signer = {}) const;
  /// Whether the last accept() for the session was with another signer: its time and its numbers
  /// are those of an answer that another member gave.
  bool is_answered_by_other(uint32_t session, const Signer& signer) const;
  /// An authentic, recent message is accepted.
  void note(const SessionStamp& stamp, const ReceiverTime& now);
  /// The session has just answered a question: `newest.sent` is its time now, `newest.sequence` its
  /// last message. With the first answer of a signer, older messages are not accepted any more.
  void accept(const SessionStamp& newest, const ReceiverTime& now, const Signer& signer = {});
  /// How many sessions were forgotten. Answers to questions of before may then be older than what
  /// was received, and are worth nothing.
  int64_t forgotten() const { return forgotten_; }

 private:
  struct Session {
    uint32_t id = 0;
    uint32_t newest = 0;
    bool has_answered = false;
    Signer answered_by;  ///< the last time
    RealtimeInstant newest_sent = RealtimeInstant::min();
    MonotonicInstant received_at;  ///< the last of them
    // A message that was fast: when it was sent, and received.
    RealtimeInstant fast_sent;
    MonotonicInstant fast_received;
    std::bitset<kWindow> received;  ///< by sequence number modulo kWindow

    /// How much longer the message took than the fast one; negative when it was faster.
    Duration delay(RealtimeInstant sent, MonotonicInstant now) const {
      return (now - fast_received) - (sent - fast_sent);
    }
    Duration drift(MonotonicInstant now) const {
      return from_seconds(kDrift * to_seconds(now - fast_received));
    }
  };
  const Session* find(uint32_t session) const;
  Session& find_or_add(const SessionStamp& stamp, const ReceiverTime& now);

  std::vector<Session> sessions_;
  RealtimeInstant floor_ = RealtimeInstant::min();
  int64_t forgotten_ = 0;
};

/// Which sessions have been asked for a sign of life, and with which nonce. One thread.
class SessionQuestions {
 public:
  /// A session is asked at most so often, and so many are waited for at once.
  static constexpr Duration kAgainAfter = std::chrono::milliseconds(200);
  static constexpr Duration kAnsweredWithin = std::chrono::seconds(2);
  static constexpr size_t kMaxPending = 16;

  /// The nonce to ask the session with; empty when it was asked a moment ago. `signer`: whose
  /// answer counts; empty: that of any member.
  std::optional<int64_t> ask(uint32_t session, MonotonicInstant now, const Signer& signer = {});
  /// Whether an answer of `signer` with this nonce would be one to a question that is pending.
  bool is_pending(uint32_t session, int64_t nonce, MonotonicInstant now,
                  const Signer& signer = {}) const;
  /// Whether this answers a question that is pending, which then is not any more.
  bool answers(uint32_t session, int64_t nonce, MonotonicInstant now, const Signer& signer = {});

 private:
  struct Question {
    uint32_t session = 0;
    int64_t nonce = 0;  ///< 0: free
    Signer signer;
    MonotonicInstant first_asked, last_asked;
    bool is_pending(MonotonicInstant now) const {
      return nonce != 0 && now - first_asked < kAnsweredWithin;
    }
    bool is_of(const Signer& other) const { return !signer || signer == other; }
  };
  const Question* find(uint32_t session, int64_t nonce, MonotonicInstant now,
                       const Signer& signer) const;
  std::array<Question, kMaxPending> questions_;
};

}  // namespace v3d
