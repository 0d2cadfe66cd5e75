// The studio's end of the simulated trigger cable (base/trigger_wire.h).
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <thread>
#include <vector>

#include "base/time.h"

namespace v3d::sim {

/// Listens on a Unix socket; every edge that a client sends is counted, handed to the cameras and
/// echoed to all clients. Owns a thread that ends with it; removes the socket file.
class TriggerCable {
 public:
  /// `edge` counts from 0 over the cable's life. Called by the cable's thread; must not throw.
  using OnEdge = std::function<void(int64_t edge, MonotonicInstant edge_time)>;

  /// Throws InputError when the path is too long for a socket, or another studio listens there. A
  /// socket that nobody listens on any more is replaced.
  TriggerCable(std::filesystem::path path, OnEdge on_edge);
  ~TriggerCable();
  TriggerCable(const TriggerCable&) = delete;
  TriggerCable& operator=(const TriggerCable&) = delete;

  int64_t edges() const { return edges_; }
  /// Packets that were no edge; they are ignored.
  int64_t malformed() const { return malformed_; }

 private:
  void serve();
  /// False when the client has gone.
  bool take_packet(int client);

  std::filesystem::path path_;
  OnEdge on_edge_;
  int listener_ = -1;
  int stop_ = -1;  ///< eventfd: readable when the thread shall end
  std::vector<int> clients_;
  std::atomic<int64_t> edges_{0};
  std::atomic<int64_t> malformed_{0};
  std::thread thread_;
};

}  // namespace v3d::sim
