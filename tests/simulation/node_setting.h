// Common state of a simulated studio (World) and of one of its hosts (Host).
#pragma once

#include <string>
#include <vector>

#include "simulation/network.h"
#include "simulation/node_disk.h"
#include "simulation/protocol_events.h"
#include "simulation/trigger.h"
#include "simulation/truth.h"
#include "simulation/virtual_time.h"
#include "wire/secret_keys.h"

namespace v3d::simulation {

/// Objects that all nodes and operators of a studio share.
struct World {
  VirtualTime& time;
  Draws& draws;
  Network& network;
  Truth& truth;
  ProtocolEvents& events;
  const wire::StudioKey& key;
  bool has_sense_line = true;
  double rate_hz = 10;
};

/// One host; it outlives the processes on it.
struct Host {
  std::string name;
  bool captures = true;
  std::vector<std::string> cameras;
  Trigger* trigger = nullptr;  ///< null on hosts without the trigger
  NodeDisk disk;
  double not_ready = 0.02;  ///< share of the orders for which a device of the node is not ready
  double frame_loss = 0;    ///< share of the frames that a camera does not deliver
  Duration clock_error{};
};

/// CLOCK_REALTIME of a host.
inline RealtimeInstant wall_clock(const World& world, Duration error) {
  return from_ns<Realtime>(1'700'000'000'000'000'000 + to_ns(world.time.now())) + error;
}

}  // namespace v3d::simulation
