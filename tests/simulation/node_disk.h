// Simulated disk of a node. Its content survives a crash of the node.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "wire/messages.h"

namespace v3d::simulation {

/// One take in the storage of one node.
struct TakeOnDisk {
  bool is_open = true;  ///< take.toml says "recording"
  std::vector<std::string> cameras;
  std::map<std::string, std::vector<int64_t>> frames;   ///< pulses in <camera>.lcmlog
  take::PulseSet pulses;                                ///< pulses.lcmlog
  std::optional<take::Ledger> ledger;                   ///< ledger.toml
  std::optional<wire::CommandMessage> persisted_order;  ///< .order-<node>
  int64_t meshes = 0;                                   ///< mesh.v3d, where the node reconstructs

  bool has_frames_or_pulses() const {
    for (const auto& [camera, written] : frames) {
      if (!written.empty()) return true;
    }
    return pulses.size() > 0;
  }
};

/// All takes of one node, by name.
struct NodeDisk {
  bool is_full = false;        ///< frames cannot be written; space for ledgers is reserved
  bool loses_ledgers = false;  ///< ledger.toml and take.toml cannot be written
  std::map<std::string, TakeOnDisk> takes;

  /// The recorded takes that were not closed, because the ledger could not be written or the node
  /// crashed; a restart recovers them.
  std::vector<std::string> open_takes() const {
    std::vector<std::string> open;
    for (const auto& [name, take] : takes) {
      if (take.is_open && take.has_frames_or_pulses()) open.push_back(name);
    }
    return open;
  }
  std::map<std::string, wire::CommandMessage> persisted_commands() const {
    std::map<std::string, wire::CommandMessage> orders;
    for (const auto& [name, take] : takes) {
      if (take.persisted_order) orders.emplace(name, *take.persisted_order);
    }
    return orders;
  }
  void clear_orders() {
    for (auto& [name, take] : takes) take.persisted_order.reset();
  }
};

/// Identifier of an order: its sender and counter.
inline std::string order_id(const wire::CommandMessage& order) {
  return order.sender + "#" + std::to_string(order.counter);
}

}  // namespace v3d::simulation
