// A shard on the studio's network.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "daemon/bus/bus.h"
#include "daemon/node/heartbeat.h"
#include "daemon/recond/shard.h"

namespace v3d {

/// Lives from the moment the take is armed until it is closed. A thread listens to the other nodes,
/// tells them where this one stands, and shows the ordered meshes when it is this node's turn.
class SharedTake {
 public:
  struct Receivers {
    /// A set to make a mesh of here. Must not wait.
    std::function<void(ReadySet)> work;
    /// The meshes of all nodes in the order of their pulses, each once, before or after they are
    /// shown. One call at a time, on whatever thread.
    std::function<void(const MeshMessage&)> ordered;
    /// The frame groups to be heard from now on. One call at a time, on whatever thread.
    std::function<void(const FrameGroupSet&)> hear;
  };
  /// `bus` outlives it.
  SharedTake(const Shard::Setup& setup, Bus& bus, Receivers receivers);
  ~SharedTake() { end(); }
  SharedTake(const SharedTake&) = delete;
  SharedTake& operator=(const SharedTake&) = delete;

  /// Any thread, but not from a receiver.
  void add(ReadySet set);
  bool begin(int64_t pulse);  ///< Shard::begin()
  void made(MeshMessage mesh);
  /// Any thread, also from a receiver.
  void gave_up(int64_t pulse);

  ShardCounts counts() const;
  std::vector<int64_t> without_mesh() const;
  bool is_settled() const;
  int64_t undecodable() const;
  bool progressed_since(MonotonicInstant since) const { return listening_.beat_since(since); }
  /// Ends the thread: nobody hears of this node any more.
  void end();

 private:
  void run();
  void hear_all();
  void act();
  void say();

  const std::string me_;
  Bus& bus_;
  const Receivers receivers_;
  Subscription<ShardMessage> words_;
  Subscription<ShardMeshMessage> meshes_;
  Subscription<MeshMessage> shown_;
  std::atomic<int64_t> mesh_seq_ = 0;  ///< of this node's own channel

  mutable std::mutex given_up_mutex_;  ///< the last to be locked
  std::vector<int64_t> given_up_;

  mutable std::mutex mutex_;  ///< what follows
  Shard shard_;
  std::optional<FrameGroupSet> heard_;
  int64_t shown_seq_ = 0;
  int64_t word_seq_ = 0;
  MonotonicInstant next_word_;

  Heartbeat listening_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d
