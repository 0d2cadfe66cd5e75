// Text and JSON of the nodes' replies to a command, and the ledgers in replies to a stop. Pure.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/control/operator_client.h"
#include "take/ledger/ledger.h"

namespace v3d::ctl {

using Json = nlohmann::ordered_json;

/// One line for each node that received the command, in the order of `nodes`. Neighbours with equal
/// replies share a line ("cap01-cap15"). `done_word`: printed before the reply of a node that
/// executed the command. `health`: of the nodes, for the line of a node without a reply; otherwise
/// it has the next step.
std::vector<std::string> reply_lines(const std::vector<std::string>& nodes,
                                     const control::Answer& answer, const std::string& done_word,
                                     const std::map<std::string, wire::HealthMessage>& health = {});

/// {"done", "replies" [{"node", "outcome", "text", "detail"}], "silent" [..]}
Json answer_json(const control::Answer& answer);

/// Work of one of several reconstruction nodes in a take.
struct ShardAccount {
  std::string node;
  int64_t made = 0;        ///< meshes
  int64_t taken_over = 0;  ///< of these, for an absent node
};

/// Result of a take: the nodes' ledgers merged to one, and the counts of the reconstruction.
struct TakeAccount {
  take::Ledger ledger;
  bool is_counted = false;  ///< a ledger could be read; otherwise `ledger` has at most a name
  std::vector<std::string> merged;      ///< nodes whose ledgers are merged
  std::vector<std::string> unreadable;  ///< nodes whose reply has no ledger that can be read
  /// Nodes whose ledger belongs to another take than that of the majority; they are not merged.
  std::vector<std::string> of_another_take;
  /// Live frames that were sent and did not reach the reconstruction, by camera; no entry where
  /// this is unknown.
  std::map<std::string, int64_t> live_lost;
  /// Empty where one node reconstructs. Otherwise every node has the meshes of all nodes; the two
  /// values below are those of the node with most meshes.
  std::vector<ShardAccount> shards;
  int64_t meshes = 0;
  std::vector<int64_t> without_mesh;  ///< pulse numbers

  /// A node whose ledger cannot be read, or is too long for a reply, has recorded too.
  bool is_recorded() const { return is_counted || !unreadable.empty(); }
};

/// Merges the ledgers in replies to a stop. Commanded and sensed pulses are those of the node with
/// the greatest counts; replies of reconstruction nodes have no ledger. The cameras of a node that
/// ended early miss the later pulses, and cameras in `expected` without a ledger miss all.
TakeAccount merge_ledgers(const control::Answer& answer,
                          const std::vector<std::string>& expected = {});

/// The cameras of nodes whose ledger is not merged. A camera that the ledger of its node lacks was
/// left out when the take was armed (`v3dctl arm --allow-missing`).
std::vector<std::string> cameras_without_ledger(const Studio& studio, const TakeAccount& account);

/// True when all nodes have replied, and each ledger belongs to the take and could be read.
bool is_of_all_nodes(const TakeAccount& account, const control::Answer& answer);
/// True when nothing was recorded, or the take is complete by the ledgers of all nodes.
bool is_whole(const TakeAccount& account, const control::Answer& answer);

/// The result of a stop: problems of the take, its verdict, live_loss_line() and shards_line().
std::vector<std::string> account_lines(const TakeAccount& account);

/// "live: 12 of 15,000 frames lost on the network: cam03 7, cam05 5"; empty when none was lost.
std::string live_loss_line(const TakeAccount& account);

/// "meshes: 1,250, recon01 420, recon02 430 (12 taken over), recon03 400; no mesh of 17-18"; empty
/// where one node reconstructs.
std::string shards_line(const TakeAccount& account);

/// {"meshes", "without_mesh" [..], "nodes" [{"node", "made", "taken_over"}]}
Json shards_json(const TakeAccount& account);

/// The keys of `v3dctl verify --json`.
Json to_json(const take::Ledger& ledger);

}  // namespace v3d::ctl
