// Filter of received commands: a node executes those that are authenticated
// (daemon/bus/credentials.h), at most a few seconds old, and not received before.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/core/time.h"
#include "daemon/bus/credentials.h"
#include "wire/messages.h"

namespace v3d::control {

/// Commands since construction, by result.
struct CommandCounts {
  int64_t admitted = 0;
  int64_t unkeyed = 0;        ///< a key or the member list is missing here
  int64_t malformed = 0;      ///< authentic bytes that this version cannot decode
  int64_t forged = 0;         ///< MAC or signature is missing or wrong
  int64_t unauthorized = 0;   ///< signed by a member that is not an operator
  int64_t without_nonce = 0;  ///< authentic, but without a current nonce of this node
  int64_t replayed = 0;       ///< received before, or older than the last of its sender
};

/// Admits a command when it holds a nonce that this node drew less than 2 * kNonceLife ago. Clocks
/// take no part: a wrong clock, or one that is set during a take, neither blocks commands nor makes
/// old commands valid. Each reply of a node holds its nonce. An authentic command without a current
/// nonce is answered with the nonce, and the operator sends it again.
///
/// Against replays within the life of a nonce, the filter remembers the last command of each
/// sender. Each message of a sender, retries included, must have a later time stamp of the sender's
/// clock (CommandStamp). With too many senders, and after a restart, new nonces are drawn, so that
/// all recorded commands become invalid.
///
/// Commands that are not authentic are counted but not answered: replies would tell an attacker why
/// a command failed, and would let it generate traffic. Thread-safe.
class CommandReplayFilter {
 public:
  static constexpr Duration kNonceLife = std::chrono::seconds(5);
  static constexpr size_t kMaxSenders = 64;
  /// Limits per second of replies that hold only a nonce: to one sender, and to all. The first one
  /// keeps a flood of recorded commands of other senders from using up all replies.
  static constexpr int kMaxNonceRepliesToSender = 20;
  static constexpr int kMaxNonceReplies = 1000;

  /// `draw` returns random numbers other than 0.
  explicit CommandReplayFilter(std::string node,
                               std::function<int64_t()> draw = wire::random_nonce);

  /// Keys and members whose commands are admitted.
  bus::Credentials& credentials() { return credentials_; }

  struct Admitted {
    wire::CommandMessage command;
    bool is_current = false;  ///< false: reply kNonceMissing, do not execute
  };
  /// The command in `bytes` if it is authentic, new, and addressed to this node; else empty.
  std::optional<Admitted> admit(std::span<const uint8_t> bytes, MonotonicInstant now);
  /// The current nonce, for replies.
  int64_t nonce(MonotonicInstant now);
  /// The reply to an admitted command that is not current. The caller sets `sent`.
  wire::ReplyMessage nonce_reply(const wire::CommandMessage& command, MonotonicInstant now);

  CommandCounts counts() const;
  /// One line for the operator if commands were rejected in the 10 s before `now`, else empty.
  std::string problem(MonotonicInstant now) const;

 private:
  struct Received {
    int64_t counter = 0;
    RealtimeInstant sent;
  };
  std::optional<wire::CommandMessage> read(std::span<const uint8_t> bytes, MonotonicInstant now);
  void count_rejected(const bus::OpenedCommand& opened, MonotonicInstant now);
  bool has_current_nonce(const wire::CommandMessage& command, MonotonicInstant now) const;
  bool may_reply_nonce(const std::string& sender, MonotonicInstant now);
  bool is_new(const wire::CommandMessage& command);
  void record(const wire::CommandMessage& command, MonotonicInstant now);
  void renew_nonces(MonotonicInstant now);
  void draw_nonces(MonotonicInstant now);
  /// Allocates nothing unless the text is longer than all before.
  void set_problem(std::string_view problem, MonotonicInstant now);

  const std::string node_;
  const std::function<int64_t()> draw_;
  bus::Credentials credentials_;
  mutable std::mutex mutex_;  ///< guards the members below
  CommandCounts counts_;
  struct Nonce {
    int64_t value = 0;  ///< 0: none
    MonotonicInstant drawn;
    bool is_current(MonotonicInstant now) const {
      return value != 0 && now - drawn < 2 * kNonceLife;
    }
  };
  Nonce nonce_, nonce_before_;
  std::map<std::string, Received> senders_,
      senders_before_;  ///< since nonce_ was drawn, and before
  MonotonicInstant replies_since_;
  int nonce_replies_ = 0;
  std::map<size_t, int> nonce_replies_to_;  ///< by the hash of the sender's name
  std::string problem_;
  std::optional<MonotonicInstant> problem_time_;
};

}  // namespace v3d::control
