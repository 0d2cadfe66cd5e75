// Persisted command: the command of the running take, kept over a restart of the daemon.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "daemon/node/peer_health.h"
#include "take/take.h"
#include "wire/messages.h"

namespace v3d::node {

// Persists the command of a node's take in the folder of the take. A daemon that restarts during
// the take resumes it; after the take, it can still report the result.

/// Saves the command. Call when the take is armed; the file exists until the next command. A write
/// error is only logged: a restarted daemon then cannot resume the take.
void persist_command(const Studio& studio, const std::string& node,
                     const wire::CommandMessage& command);
/// Deletes the command of one take.
void drop_command(const Studio& studio, const std::string& node, const std::string& take);
/// Whether the folder of a take has a command of this node. Fails with path and cause.
[[nodiscard]] io::Result<bool> has_persisted_command(const take::TakePaths& take,
                                                     const std::string& node);

struct CommandsOnDisk {
  /// By take name; the take may have ended. Has more than one entry when take folders were copied
  /// to this PC.
  std::map<std::string, wire::CommandMessage> commands;
  std::set<std::string> unread;   ///< takes whose command cannot be read
  bool folder_was_listed = true;  ///< false: there may be others
};
/// The saved commands of this node. Logs why a command cannot be read.
CommandsOnDisk persisted_commands(const Studio& studio, const std::string& node);

/// Decides once whether a restarted node rejoins the running take. No input or output. One thread.
class RejoinDecision {
 public:
  struct Found {
    wire::CommandMessage command;
    int64_t commanded = 0;  ///< pulses of the take until now, or a little fewer
  };
  /// `persisted`: the commands on this node's disk, by take name.
  explicit RejoinDecision(std::map<std::string, wire::CommandMessage> persisted)
      : commands_(std::move(persisted)) {}

  /// False once the decision has been made, and without persisted commands.
  bool is_open() const { return !commands_.empty(); }
  /// The command of the running take, if it was persisted. Call with the first health of the
  /// trigger's node; closes the decision.
  std::optional<Found> decide(const TrainState::RunningTake& running);
  /// Call when the node receives a new command.
  void close() { commands_.clear(); }

 private:
  std::map<std::string, wire::CommandMessage> commands_;
};

/// The persisted commands of a node, and whether one of them belongs to the running take. One
/// thread.
class PersistedCommands {
 public:
  PersistedCommands(const Studio& studio, std::string node);

  using Found = RejoinDecision::Found;
  /// The command of the running take, at most once. Reads the health of the trigger's node; the
  /// first message decides. While a command cannot be read, it reads all again every second, and
  /// decides by a later message. Call often, until drop_all().
  std::optional<Found> find_running(TrainMonitor& train);
  /// Deletes all persisted commands, on disk too. Call when the node receives a new command.
  void drop_all();

 private:
  void read();

  const Studio& studio_;
  const std::string node_;
  CommandsOnDisk on_disk_;  ///< but for the commands, which decision_ has
  MonotonicInstant read_at_;
  RejoinDecision decision_;
};

}  // namespace v3d::node
