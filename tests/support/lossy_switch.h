// A simulated Ethernet switch between hosts (network namespaces) that drops, delays and reorders
// frames and counts the dropped ones. The kernel's netem does not count them, and some kernels lack
// it.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <queue>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/core/time.h"

namespace v3d::test {

/// Faults of every link.
struct LinkFaults {
  double loss = 0;       ///< probability that an LCM datagram is dropped, for each receiver
  Duration max_delay{};  ///< each frame is delayed by 0 to this time, so frames are reordered
  uint32_t seed = 20090219;
};

/// Forwards every frame that one port receives to all others, as a switch does with multicast. A
/// datagram must fit into one frame, so the ports need a large MTU.
///
/// Runs a thread of its own. lost() and forwarded() may be called from any thread.
class LossySwitch {
 public:
  /// `ports`: names of interfaces of this network namespace that are up. Throws std::runtime_error
  /// when one cannot be opened.
  LossySwitch(const std::vector<std::string>& ports, LinkFaults faults);
  ~LossySwitch();
  LossySwitch(const LossySwitch&) = delete;
  LossySwitch& operator=(const LossySwitch&) = delete;

  /// Number of LCM messages on `channel` that were dropped instead of forwarded to `port`.
  int64_t lost(const std::string& channel, size_t port) const;
  /// Number of forwarded frames.
  int64_t forwarded() const { return forwarded_; }

 private:
  using Bytes = std::vector<uint8_t>;
  struct DelayedFrame {
    MonotonicInstant due;
    int64_t number;
    size_t port;
    Bytes bytes;
    bool operator<(const DelayedFrame& other) const {
      return std::tie(other.due, other.number) < std::tie(due, number);
    }
  };
  void run();
  void receive_all(size_t port);
  void receive(size_t port, Bytes frame);
  void distribute(size_t from, const Bytes& frame, const std::string& channel);
  void deliver();

  const LinkFaults faults_;
  std::mt19937 random_;
  std::vector<int> sockets_;
  std::priority_queue<DelayedFrame> delayed_;
  int64_t numbered_ = 0;
  std::atomic<int64_t> forwarded_ = 0;
  mutable std::mutex mutex_;
  std::map<std::pair<std::string, size_t>, int64_t> lost_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d::test
