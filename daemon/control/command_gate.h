// Which commands a node obeys: authenticated (daemon/bus/credentials.h), sent a few seconds ago at
// most, and not received before.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "base/time.h"
#include "daemon/bus/credentials.h"
#include "wire/messages.h"

namespace v3d {

/// Commands since the gate was made, by what became of them.
struct CommandCounts {
  int64_t believed = 0;
  int64_t unkeyed = 0;       ///< a key or the member list is missing here
  int64_t malformed = 0;     ///< no command, or none that this version understands
  int64_t forged = 0;        ///< without the studio's MAC or a member's signature, or changed since
  int64_t unauthorized = 0;  ///< signed by a member that is no operator
  int64_t without_nonce = 0;  ///< authentic, with no nonce of this node or an old one
  int64_t replayed = 0;       ///< received before, or older than what was received of its sender
};

/// A command is obeyed when it holds a nonce that this node drew less than 2 * kNonceLife ago. So
/// clocks have no part in it: a clock that is wrong, or is set in the middle of a take, neither
/// makes a node deaf nor makes an old command good. A node's nonce is in each of its replies. An
/// authentic command without one, or with an old one, is answered with the present nonce, and comes
/// again with it.
///
/// Against replays within the life of a nonce, the last command of every sender is remembered: each
/// message of a sender, a retry too, must be sent later than the one before, by the sender's own
/// clock (CommandStamp). When there are too many senders, all nonces are drawn anew, and nothing
/// that was recorded is worth anything. The same holds when a daemon starts.
///
/// What is not authentic is counted and not answered: an answer would tell a stranger which of his
/// tries came how far, and would let him make every node talk. Any thread.
class CommandGate {
 public:
  static constexpr Duration kNonceLife = std::chrono::seconds(5);
  static constexpr size_t kMaxSenders = 64;
  /// Limits for each second of the replies that hold only a nonce: to one sender, and to all. A
  /// flood of recorded commands of other senders leaves an operator his share.
  static constexpr int kMaxNonceRepliesToSender = 20;
  static constexpr int kMaxNonceReplies = 1000;

  /// `draw` gives random numbers other than 0.
  explicit CommandGate(std::string node, std::function<int64_t()> draw = random_nonce);

  /// Whose commands are admitted.
  Credentials& credentials() { return credentials_; }

  struct Admitted {
    CommandMessage command;
    bool is_current = false;  ///< false: reply kNonceMissing, and do nothing
  };
  /// The command in `bytes` when it is authentic, new, and meant for this node.
  std::optional<Admitted> admit(std::span<const uint8_t> bytes, MonotonicInstant now);
  /// For replies.
  int64_t nonce(MonotonicInstant now);
  /// To an admitted command that is not current; `sent` is the caller's.
  ReplyMessage nonce_reply(const CommandMessage& command, MonotonicInstant now);

  CommandCounts counts() const;
  /// One line for a person when commands were refused shortly before `now`, else empty.
  std::string trouble(MonotonicInstant now) const;

 private:
  struct Received {
    int64_t counter = 0;
    RealtimeInstant sent;
  };
  std::optional<CommandMessage> read(std::span<const uint8_t> bytes, MonotonicInstant now);
  void count_rejected(const OpenedCommand& opened, MonotonicInstant now);
  bool has_current_nonce(const CommandMessage& command, MonotonicInstant now) const;
  bool may_reply_nonce(const std::string& sender, MonotonicInstant now);
  bool is_new(const CommandMessage& command);
  void remember(const CommandMessage& command, MonotonicInstant now);
  void renew_nonces(MonotonicInstant now);
  void draw_nonces(MonotonicInstant now);
  void note(const std::string& trouble, MonotonicInstant now);

  const std::string node_;
  const std::function<int64_t()> draw_;
  Credentials credentials_;
  mutable std::mutex mutex_;  ///< what follows
  CommandCounts counts_;
  struct Nonce {
    int64_t value = 0;  ///< 0: none
    MonotonicInstant drawn;
    bool is_current(MonotonicInstant now) const {
      return value != 0 && now - drawn < 2 * kNonceLife;
    }
  };
  Nonce nonce_, nonce_before_;
  std::map<std::string, Received> senders_, senders_before_;  ///< since a nonce, and before
  MonotonicInstant replies_since_;
  int nonce_replies_ = 0;
  std::map<size_t, int> nonce_replies_to_;  ///< by the hash of the sender's name
  std::string trouble_;
  std::optional<MonotonicInstant> troubled_;
};

}  // namespace v3d
