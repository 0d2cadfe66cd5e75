// A simulated node's disk: what survives a crash.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/ledger/pulse_set.h"
#include "wire/messages.h"

namespace v3d::simulation {

/// One take in the storage of one node.
struct TakeOnDisk {
  bool is_open = true;  ///< take.toml says "recording"
  std::vector<std::string> cameras;
  std::map<std::string, std::vector<int64_t>> frames;  ///< pulses in <camera>.lcmlog
  PulseSet pulses;                                     ///< pulses.lcmlog
  std::optional<Ledger> ledger;                        ///< ledger.toml
  std::optional<CommandMessage> kept_order;            ///< .order-<node>
  int64_t meshes = 0;                                  ///< mesh.v3d, where the node reconstructs

  bool has_frames() const {
    for (const auto& [camera, written] : frames) {
      if (!written.empty()) return true;
    }
    return false;
  }
};

struct NodeDisk {
  bool is_full = false;  ///< refuses frames; the room for ledgers is set aside
  std::map<std::string, TakeOnDisk> takes;

  std::map<std::string, CommandMessage> persisted_commands() const {
    std::map<std::string, CommandMessage> orders;
    for (const auto& [name, take] : takes) {
      if (take.kept_order) orders.emplace(name, *take.kept_order);
    }
    return orders;
  }
  void forget_orders() {
    for (auto& [name, take] : takes) take.kept_order.reset();
  }
};

/// Unique for every order to arm: its sender and counter.
inline std::string order_id(const CommandMessage& order) {
  return order.sender + "#" + std::to_string(order.counter);
}

}  // namespace v3d::simulation
