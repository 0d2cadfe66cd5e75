// The connection of a Shard to the network: its thread, status messages and meshes.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "daemon/bus/bus.h"
#include "daemon/node/service.h"
#include "daemon/recond/shard.h"

namespace v3d::recond {

/// The part of this node in one shared take, from arming until closing. A thread receives messages
/// of the other nodes, sends the status of this one every 100 ms, and publishes ordered meshes.
class SharedTake {
 public:
  /// Called with the shard locked, one call at a time, from any thread. They must not call back
  /// into SharedTake, except for give_up().
  struct Receivers {
    /// A frame set to process here. Must not block.
    std::function<void(recon::ReadySet)> on_work;
    /// The meshes of all nodes by ascending pulse, each once, before or after they are published.
    std::function<void(const wire::MeshMessage&)> on_ordered;
    /// The frame groups to receive from now on. False where one of them cannot be joined: called
    /// again with each iteration of the thread and each set. Must not throw.
    std::function<bool(const bus::FrameGroupSet&)> on_frame_groups;
  };
  /// `bus` must outlive this object.
  SharedTake(const Shard::Setup& setup, bus::Bus& bus, Receivers receivers);
  ~SharedTake() { stop(); }
  SharedTake(const SharedTake&) = delete;
  SharedTake& operator=(const SharedTake&) = delete;

  void on_pulse(int64_t pulse);  ///< see Shard::on_pulse(). Any thread.
  /// A frame set that was assembled here, by ascending pulse. Any thread.
  void add(recon::ReadySet set);
  bool begin(int64_t pulse);  ///< see Shard::begin(). Any thread.
  /// A mesh that was made here. Sends it to the other nodes. Any thread.
  void add_mesh(wire::MeshMessage mesh);
  /// See Shard::give_up(). Takes effect with the next iteration of the thread. Any thread, also
  /// from a receiver.
  void give_up(int64_t pulse);

  ShardCounts counts() const;
  std::vector<int64_t> without_mesh() const;
  bool is_settled() const;
  int64_t undecodable() const;
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.beat_since(since); }
  /// Ends the thread. The other nodes then see this node as silent.
  void stop();

 private:
  void run();
  void receive();
  void process();
  void send_status();

  const std::string node_;
  bus::Bus& bus_;
  const Receivers receivers_;
  bus::Subscription<wire::ShardMessage> statuses_;
  bus::Subscription<wire::ShardMeshMessage> meshes_;
  bus::Subscription<wire::MeshMessage> published_;
  std::atomic<int64_t> mesh_seq_ = 0;  ///< on the channel of this node

  mutable std::mutex given_up_mutex_;  ///< locked last
  std::vector<int64_t> given_up_;

  mutable std::mutex mutex_;  ///< guards the members below
  Shard shard_;
  std::optional<bus::FrameGroupSet> groups_;  ///< last for which on_frame_groups returned true
  int64_t published_seq_ = 0;
  int64_t status_seq_ = 0;
  MonotonicInstant next_status_;

  node::Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d::recond
