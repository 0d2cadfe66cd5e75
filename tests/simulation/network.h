// Simulated multicast network. It loses, repeats, delays and reorders datagrams, and can be
// partitioned.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "simulation/virtual_time.h"
#include "wire/codec.h"

namespace v3d::simulation {

enum class Channel : uint8_t { kCommand, kReply, kHealth, kPulse, kSession };

/// Probabilities of faults, 0 to 1.
struct NetworkFaults {
  double loss = 0;    ///< share of the datagrams, for each receiver
  double repeat = 0;  ///< share that arrives twice
  double late = 0;    ///< share delayed by up to `latest` more than the usual 0.5 to 20 ms
  Duration latest{};
};

/// Delivers datagrams through VirtualTime. One thread.
class Network {
 public:
  /// `from` is the index of the sender's host.
  using Receiver = std::function<void(Channel channel, size_t from, const wire::Bytes& bytes)>;
  using Interest = std::function<bool(Channel channel, size_t from)>;

  Network(VirtualTime& time, Draws& draws) : time_(time), draws_(draws) {}

  /// Adds a host and returns its index. `interest` is true for the channels and senders that the
  /// host subscribes to.
  size_t join(Interest interest, Receiver receiver) {
    hosts_.push_back({std::move(interest), std::move(receiver), 0});
    return hosts_.size() - 1;
  }
  void set_faults(const NetworkFaults& faults) { faults_ = faults; }

  void send(size_t from, Channel channel, wire::Bytes bytes) {
    const auto datagram = std::make_shared<const wire::Bytes>(std::move(bytes));
    for (size_t to = 0; to < hosts_.size(); ++to) {
      if (to == from || !hosts_[to].interest(channel, from)) continue;
      if (!draws_.chance(faults_.loss)) post(from, to, channel, datagram);
      if (draws_.chance(faults_.repeat)) post(from, to, channel, datagram);
    }
  }

  /// Partitions the network: hosts of different parts do not receive each other's datagrams.
  void put_into_part(size_t host, int part) { hosts_[host].part = part; }
  void join_parts() {
    for (Host& host : hosts_) host.part = 0;
  }

 private:
  struct Host {
    Interest interest;
    Receiver receiver;
    int part = 0;
  };
  void post(size_t from, size_t to, Channel channel,
            const std::shared_ptr<const wire::Bytes>& datagram) {
    if (hosts_[from].part != hosts_[to].part) return;
    const bool late = draws_.chance(faults_.late);
    const Duration delay = draws_.seconds(0.0005, 0.02) +
                           (late ? draws_.seconds(0, to_seconds(faults_.latest)) : Duration{});
    time_.after(delay, [this, from, to, channel, datagram] {
      hosts_[to].receiver(channel, from, *datagram);
    });
  }

  VirtualTime& time_;
  Draws& draws_;
  NetworkFaults faults_;
  std::vector<Host> hosts_;
};

}  // namespace v3d::simulation
