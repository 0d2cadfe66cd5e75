// One daemon of a simulated studio: the real filter, state machine and protocol on simulated work.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/bus/session_replay_filter.h"
#include "daemon/control/command_replay_filter.h"
#include "daemon/control/node_protocol.h"
#include "simulation/node_setting.h"
#include "simulation/simulated_work.h"
#include "simulation/trace.h"

namespace v3d::simulation {

/// Survives its own crashes, as a host does; the daemon on it does not. One thread.
class NodeProcess {
 public:
  NodeProcess(World& world, Trace& trace, Host host, bool is_trigger);

  void boot();
  /// Everything in memory is gone, at once.
  void crash();
  /// As systemd ends a daemon: a take is drained for some seconds.
  void ask_to_end();
  /// The process stands still; datagrams wait for it.
  void pause();
  void resume();

  bool is_up() const { return protocol_ != nullptr; }
  bool is_trigger() const { return is_trigger_; }
  Phase phase() const { return is_up() ? protocol_->phase() : Phase::kIdle; }
  std::string id() const { return is_up() ? order_id(protocol_->order()) : ""; }
  Host& host() { return host_; }
  size_t place() const { return place_; }
  CommandCounts counts() const { return filter_ ? filter_->counts() : CommandCounts{}; }
  SimulatedWork* work() { return work_.get(); }

  /// Tells the places whose health this node listens to: that of the trigger's node, or of all
  /// others.
  void listen_to_trigger_at(size_t place) { trigger_place_ = place; }
  /// As PulseRecorder does: the last pulse is sent three times more, since no later one would tell
  /// of its loss.
  void send_pulse(int64_t pulse);

 private:
  void send_again(const Bytes& bytes, int64_t seq, int times);
  void recover_takes();
  void receive(Channel channel, size_t from, const Bytes& bytes);
  void take_in(Channel channel, size_t from, const Bytes& bytes);
  void turn();
  void plan_turn(MonotonicInstant at);
  void watch(Cause cause, const CommandMessage& command, const std::function<void()>& action);
  void publish(ReplyMessage reply);
  void publish_health();
  void lose_trigger();
  void end(Cause cause);
  /// As Realtime::now(): the host's clock without its steps.
  RealtimeInstant clock() const { return wall_clock(world_, clock_error_); }
  ReceiverTime receiver_time() const { return {world_.time.now(), clock()}; }
  void send(Channel channel, const Bytes& message);
  bool accepts(const SessionStamp& stamp);
  void on_session_message(const SessionMessage& message, const SessionStamp& stamp);

  struct Datagram {
    Channel channel;
    size_t from;
    Bytes bytes;
  };

  World& world_;
  Trace& trace_;
  Host host_;
  const bool is_trigger_;
  size_t place_ = 0;
  size_t trigger_place_ = 0;

  // Of the process.
  std::unique_ptr<SimulatedWork> work_;
  std::unique_ptr<NodeProtocol> protocol_;
  std::unique_ptr<CommandReplayFilter> filter_;
  Duration clock_error_{};
  uint32_t session_ = 0;
  uint32_t sequence_ = 0;
  SessionReplayFilter sessions_;
  SessionQuestions questions_;
  std::deque<CommandReplayFilter::Admitted> commands_;
  int64_t pulse_seq_ = 0;
  bool is_paused_ = false;
  bool is_ending_ = false;
  std::vector<Datagram> waiting_;  ///< while it is paused
  int64_t turn_ = 0;               ///< counts plans: one that was replaced comes to nothing
};

}  // namespace v3d::simulation
