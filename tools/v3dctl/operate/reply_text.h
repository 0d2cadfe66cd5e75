// What the operator reads, made of what the nodes said. Pure.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "daemon/operator_client.h"
#include "take/ledger.h"

namespace v3d::ctl {

using Json = nlohmann::ordered_json;

/// One line per node that was asked, in the order of `nodes`; neighbours that said the same share
/// one ("cap01-cap15"). `done_word` stands before what a node said that did as told. Silent nodes
/// are told with what their health says is wrong, else with the next step.
std::vector<std::string> reply_lines(const std::vector<std::string>& nodes, const Answer& answer,
                                     const std::string& done_word,
                                     const std::map<std::string, HealthMessage>& health = {});

/// {"done", "replies" [{"node", "outcome", "text"}], "silent" [..]}
Json answer_json(const Answer& answer);

/// The ledger of the whole take from the details that nodes give at its stop: cameras side by side;
/// commanded and sensed by the node that counts most. Details without cameras (of a reconstruction)
/// are passed over.
struct ShardAccount {
  std::string node;
  int64_t made = 0;
  int64_t taken_over = 0;
};
struct TakeAccount {
  Ledger ledger;
  std::vector<std::string> unreadable;  ///< nodes whose detail is no ledger and nothing else
  /// Nodes whose ledger is of another take than that of most: it is left out.
  std::vector<std::string> of_another_take;
  /// Live frames that were sent and did not reach the reconstruction, by camera; empty when that is
  /// not known.
  std::map<std::string, int64_t> live_lost;
  /// What each node did, where several share the reconstruction. Each has the meshes of all: those
  /// of the take, and the pulses without one, are as the node says that has most.
  std::vector<ShardAccount> shards;
  int64_t meshes = 0;
  std::vector<int64_t> without_mesh;
};
/// A node that ended before the take did knows nothing of the later pulses: its cameras miss them.
/// So do the cameras among `expected` of which no account came.
TakeAccount merge_ledgers(const Answer& answer, const std::vector<std::string>& expected = {});
/// "live: 12 of 15,000 frames lost on the network: cam03 7, cam05 5"; empty when none was.
std::string live_line(const TakeAccount& account);
/// "meshes: 1,250, recon01 420, recon02 430 (12 taken over), recon03 400; no mesh of 17-18"; empty
/// where one node reconstructs.
std::string shards_line(const TakeAccount& account);
/// {"meshes", "without_mesh" [..], "nodes" [{"node", "made", "taken_over"}]}
Json shards_json(const TakeAccount& account);
/// The keys of `v3dctl verify --json`.
Json to_json(const Ledger& ledger);

/// "cap01  v3d-captured  recording kendo-07  cam07 silent", one line per node, in the order of
/// `nodes`; nodes that were not heard are "silent".
std::vector<std::string> status_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, HealthMessage>& health);
Json health_json(const std::vector<std::string>& nodes,
                 const std::map<std::string, HealthMessage>& health);
/// Every node was heard and none is at fault.
bool all_well(const std::vector<std::string>& nodes,
              const std::map<std::string, HealthMessage>& health);

/// Every one of the nodes has been heard.
bool all_heard(const std::vector<std::string>& nodes,
               const std::map<std::string, HealthMessage>& health);
/// The node records, or still closes a take.
bool is_at_work(const HealthMessage& health);

/// A value added up over the nodes; empty when none reports it.
std::optional<double> total(const std::map<std::string, HealthMessage>& health,
                            const std::string& name);

/// "300 pulses   15/15 cameras   0 missing   live 25.0/s, 71 ms", of what is known.
std::string recording_line(const std::map<std::string, HealthMessage>& health);

}  // namespace v3d::ctl
