// Messages of the simulated trigger cable, a Unix socket (SOCK_SEQPACKET) on which the simulated
// studio listens.
// The generator is one client, the sense line another. A packet is one rising edge (TriggerEdge),
// in either direction: the studio exposes its cameras at every edge it receives, and sends the edge
// back to all clients, which a sense line reads.
// As on a real cable, an edge carries no pulse number.
#pragma once

#include <cstdint>

namespace v3d {

struct TriggerEdge {
  int64_t edge_monotonic_ns = 0;  ///< CLOCK_MONOTONIC; both ends are on one machine
};

}  // namespace v3d
