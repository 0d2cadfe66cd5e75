// Server of the simulated trigger cable, a Unix socket (base/config/studio_values.h).
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <thread>
#include <vector>

#include "base/core/time.h"

namespace v3d::sim {

/// Accepts clients on a Unix socket. Each edge from a client is counted, passed to the cameras and
/// echoed to all clients. The destructor stops the thread and removes the socket file.
class TriggerCable {
 public:
  /// `edge` counts from 0. Called by the cable's thread; must not throw.
  using OnEdge = std::function<void(int64_t edge, MonotonicInstant edge_time)>;

  /// Replaces an unused socket file. Throws InputError where the path is too long for a socket or
  /// where another process listens on it.
  TriggerCable(std::filesystem::path path, OnEdge on_edge);
  ~TriggerCable();
  TriggerCable(const TriggerCable&) = delete;
  TriggerCable& operator=(const TriggerCable&) = delete;

  int64_t edges() const { return edges_; }
  /// The number of ignored, malformed packets.
  int64_t malformed() const { return malformed_; }

 private:
  void serve();
  /// Returns false where the client has disconnected.
  bool take_packet(int client);

  std::filesystem::path path_;
  OnEdge on_edge_;
  int listener_ = -1;
  int stop_ = -1;  ///< eventfd: readable when the thread must stop
  std::vector<int> clients_;
  std::atomic<int64_t> edges_{0};
  std::atomic<int64_t> malformed_{0};
  std::thread thread_;
};

}  // namespace v3d::sim
