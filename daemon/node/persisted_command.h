// The order of a node's last take, kept in the folder of the take, for a daemon that is started
// anew in the middle of it, or before somebody has asked how it ended.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "base/studio_file.h"
#include "daemon/node/train_monitor.h"
#include "wire/messages.h"

namespace v3d {

/// From the moment the take is armed until something new is ordered. A disk that refuses is none's
/// business here: the node could then not go on with the take.
void persist_command(const Studio& studio, const std::string& node, const CommandMessage& order);
void drop_command(const Studio& studio, const std::string& node, const std::string& take);
/// By the names of the takes: the last take of this node, be it over or not. More than one where
/// folders were copied here.
std::map<std::string, CommandMessage> persisted_commands(const Studio& studio,
                                                         const std::string& node);

/// Decides once, for a node that has restarted, whether it rejoins the take that runs. Pure. One
/// thread.
class RejoinDecision {
 public:
  struct Found {
    CommandMessage order;
    int64_t commanded = 0;  ///< pulses of the take until now, or a little fewer
  };
  /// `kept`: the orders on this node's disk, by the names of their takes.
  explicit RejoinDecision(std::map<std::string, CommandMessage> kept) : orders_(std::move(kept)) {}

  bool is_open() const { return !orders_.empty(); }
  /// At the first word of what the trigger's node records; it closes the decision.
  std::optional<Found> decide(const TrainState::Running& running);
  /// Something new was ordered.
  void close() { orders_.clear(); }

 private:
  std::map<std::string, CommandMessage> orders_;
};

/// Finds out whether one of the kept orders is of the take that runs. One thread.
class PersistedCommands {
 public:
  PersistedCommands(const Studio& studio, std::string node);

  using Found = RejoinDecision::Found;
  /// Once, and only as long as the trigger's node has not been heard to be at something else: from
  /// then on none runs. To be called often, until forget().
  std::optional<Found> running(TrainMonitor& train);
  /// Something new was ordered: all kept orders are dropped, on the disk too.
  void forget();

 private:
  const Studio& studio_;
  const std::string node_;
  RejoinDecision decision_;
};

}  // namespace v3d
