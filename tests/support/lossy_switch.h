// A switch between hosts (network namespaces) that loses, delays and reorders what it forwards, and
// keeps account of it: the kernel's netem, which not every kernel has, does not.
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

struct Road {
  double loss = 0;     ///< of the LCM datagrams, for every receiver by itself
  Duration slowest{};  ///< each takes from nothing to so long: later ones overtake
  uint32_t seed = 20090219;
};

/// Forwards every frame that one port receives to all others, as a switch does with multicast. A
/// datagram must fit into one frame: the ports want a large MTU.
class LossySwitch {
 public:
  /// `ports`: names of interfaces of this network namespace, up. Throws std::runtime_error.
  LossySwitch(const std::vector<std::string>& ports, Road road);
  ~LossySwitch();
  LossySwitch(const LossySwitch&) = delete;
  LossySwitch& operator=(const LossySwitch&) = delete;

  /// LCM messages on `channel` that were not forwarded to `port`.
  int64_t lost(const std::string& channel, size_t port) const;
  int64_t forwarded() const { return forwarded_; }

 private:
  using Bytes = std::vector<uint8_t>;
  struct Parcel {
    MonotonicInstant due;
    int64_t number;
    size_t port;
    Bytes bytes;
    bool operator<(const Parcel& other) const {
      return std::tie(other.due, other.number) < std::tie(due, number);
    }
  };
  void run();
  void receive_all(size_t port);
  void receive(size_t port, Bytes frame);
  void distribute(size_t from, const Bytes& frame, const std::string& channel);
  void deliver();

  const Road road_;
  std::mt19937 random_;
  std::vector<int> sockets_;
  std::priority_queue<Parcel> on_their_way_;
  int64_t numbered_ = 0;
  std::atomic<int64_t> forwarded_ = 0;
  mutable std::mutex mutex_;
  std::map<std::pair<std::string, size_t>, int64_t> lost_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d::test
