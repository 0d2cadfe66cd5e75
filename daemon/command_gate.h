// Which commands a node believes: sealed with the studio key, of now, and not heard before.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "base/time.h"
#include "wire/messages.h"
#include "wire/studio_key.h"

namespace v3d {

/// Commands since the gate was made, by what became of them.
struct CommandCounts {
  int64_t believed = 0;
  int64_t unkeyed = 0;    ///< nobody is believed, for there is no studio key here
  int64_t malformed = 0;  ///< no command, or none that this version understands
  int64_t forged = 0;     ///< without the studio's seal, or changed since it was sealed
  int64_t stale = 0;      ///< sealed, but sent too long ago, or in the future
  int64_t early = 0;      ///< sent before this node began, or before what it can remember
  int64_t replayed = 0;   ///< heard before, or older than what was heard of its sender
};

/// What is not believed is counted and not answered: an answer would tell a stranger which of his
/// tries came how far, and would let him make every node talk. Any thread.
///
/// Against replays every sender's last command is remembered: each message of a sender, a retry
/// too, must be sent later than the one before. Senders that there is no room to remember, and all
/// of them when a daemon starts, are covered by a floor: from a sender that is not known, only
/// commands sent after the floor are believed. Nothing need be kept on disk for that: what a node
/// had believed before it ended was sent no later than kAhead after its end, so a node that begins
/// believes nothing that was sent up to kAhead after its beginning.
class CommandGate {
 public:
  /// A command may be so old: networks and clocks are slow.
  static constexpr Duration kOldest = std::chrono::seconds(5);
  /// So far may the clock of the sender be ahead of this node's.
  static constexpr Duration kAhead = std::chrono::seconds(2);
  static constexpr size_t kMaxSenders = 64;

  /// `began`: when this process began, or later.
  CommandGate(std::string node, RealtimeInstant began);

  void set_key(const StudioKey& key);
  bool has_key() const;

  /// The command in `bytes` when it is believed and meant for this node.
  std::optional<CommandMessage> admit(std::span<const uint8_t> bytes, RealtimeInstant now);

  CommandCounts counts() const;
  /// One line for a person when commands were refused shortly before `now`, else empty.
  std::string trouble(RealtimeInstant now) const;

 private:
  struct Heard {
    int64_t counter = 0;
    RealtimeInstant sent;
  };
  std::optional<CommandMessage> judge(std::span<const uint8_t> bytes, RealtimeInstant now);
  bool is_fresh(const CommandMessage& command, RealtimeInstant now);
  bool is_new(const CommandMessage& command);
  void remember(const CommandMessage& command);
  void note(const std::string& trouble, RealtimeInstant now);

  const std::string node_;
  mutable std::mutex mutex_;  ///< what follows
  std::optional<StudioKey> key_;
  CommandCounts counts_;
  RealtimeInstant floor_;
  std::map<std::string, Heard> senders_;
  std::string trouble_;
  RealtimeInstant troubled_;
};

}  // namespace v3d
