// One end of the simulated trigger cable (base/core/trigger_edge.h).
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>

#include "base/core/time.h"
#include "base/core/trigger_edge.h"

namespace v3d {

/// A connected client. Owns the socket. A cable whose other end vanished neither blocks nor
/// signals: the functions say so. One thread, but for vanished().
class WireSocket {
 public:
  /// Throws InputError when nobody listens at `path`.
  explicit WireSocket(const std::filesystem::path& path);
  ~WireSocket();
  WireSocket(const WireSocket&) = delete;
  WireSocket& operator=(const WireSocket&) = delete;

  /// False when the other end vanished or does not read.
  bool send(const TriggerEdge& edge);
  /// The next edge, waiting until `deadline`; empty when none came or the other end vanished.
  std::optional<TriggerEdge> receive(MonotonicInstant deadline);
  /// Throws away what has arrived.
  void drain();
  bool vanished() const { return vanished_; }  ///< any thread

 private:
  /// One packet that is already there.
  std::optional<TriggerEdge> receive_now();

  int fd_ = -1;
  std::atomic<bool> vanished_ = false;
};

}  // namespace v3d
