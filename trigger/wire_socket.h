// Client socket of the simulated trigger cable (base/core/trigger_edge.h).
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>

#include "base/core/time.h"
#include "base/core/trigger_edge.h"

namespace v3d {

/// A connected client; owns the socket. After a disconnection the functions report it: they do not
/// block and raise no SIGPIPE. Threads: one caller, except for disconnected().
class WireSocket {
 public:
  /// Throws InputError when no server listens at `path` or the path is too long.
  explicit WireSocket(const std::filesystem::path& path);
  ~WireSocket();
  WireSocket(const WireSocket&) = delete;
  WireSocket& operator=(const WireSocket&) = delete;

  /// Returns false when the server has disconnected or does not read.
  bool send(const TriggerEdge& edge);
  /// Waits for the next edge until `deadline`; empty when none came or the server disconnected.
  std::optional<TriggerEdge> receive(MonotonicInstant deadline);
  /// Discards the edges that have arrived.
  void drain();
  bool disconnected() const { return disconnected_; }  ///< any thread

 private:
  /// Receives one edge without waiting.
  std::optional<TriggerEdge> receive_now();

  int fd_ = -1;
  std::atomic<bool> disconnected_ = false;
};

}  // namespace v3d
