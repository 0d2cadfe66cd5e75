// Simulated host with one daemon: the real CommandReplayFilter and NodeProtocol on simulated work.
#pragma once

#include <deque>
#include <functional>
#include <map>
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

/// The object is the host and outlives crashes of its daemon. One thread.
class NodeProcess {
 public:
  NodeProcess(World& world, Trace& trace, Host host, bool is_trigger);

  /// Starts the daemon, if it does not run.
  void boot();
  /// Ends the daemon at once; all its memory is lost.
  void crash();
  /// Shuts the daemon down as systemd does: a running take is drained first.
  void ask_to_end();
  /// Stops the process. Until resume(), datagrams wait, and edges and frames as far as the buffers
  /// of the kernel have room.
  void pause();
  void resume();

  bool is_up() const { return protocol_ != nullptr; }
  bool is_trigger() const { return is_trigger_; }
  control::Phase phase() const { return is_up() ? protocol_->phase() : control::Phase::kIdle; }
  std::string id() const { return is_up() ? order_id(protocol_->order()) : ""; }
  Host& host() { return host_; }
  size_t place() const { return place_; }
  control::CommandCounts counts() const {
    return filter_ ? filter_->counts() : control::CommandCounts{};
  }
  SimulatedWork* work() { return work_.get(); }

  /// Sets the host index of the trigger's node. Other nodes receive its health and pulses; the
  /// trigger's node receives the health of all nodes.
  void listen_to_trigger_at(size_t place) { trigger_place_ = place; }
  /// A pulse on the sense line. The process, which runs, sends it as PulseRecorder does. The last
  /// pulse is sent three more times, because no later pulse reveals its loss.
  void on_sensed(int64_t pulse);
  /// A frame of one of the node's cameras, or a pulse to reconstruct.
  void on_frame(const std::string& camera, int64_t pulse);

 private:
  void send_pulse(int64_t pulse, RealtimeInstant edge);
  void repeat_pulse(const wire::Bytes& bytes, int64_t seq, int times);
  void recover_takes();
  void receive(Channel channel, size_t from, const wire::Bytes& bytes);
  void process(Channel channel, size_t from, const wire::Bytes& bytes);
  void turn();
  void plan_turn(MonotonicInstant at);
  void run_observed(Cause cause, const wire::CommandMessage& command,
                    const std::function<void()>& action);
  void publish(wire::ReplyMessage reply);
  void publish_health();
  void stop_lost_trigger();
  void end(Cause cause);
  /// The daemon's wall clock, as Realtime::now(): it follows steps of the host's clock only when
  /// idle.
  RealtimeInstant clock() const { return wall_clock(world_, clock_error_); }
  bus::ReceiverTime receiver_time() const { return {world_.time.now(), clock()}; }
  void send(Channel channel, const wire::Bytes& message);
  bool accepts(const bus::SessionStamp& stamp);
  void on_session_message(const wire::SessionMessage& message, const bus::SessionStamp& stamp);

  /// The kernel keeps 16 edges of a line (GPIO), and a camera has as many buffers
  /// ([[camera]] buffers).
  static constexpr int64_t kMaxWaiting = 16;

  World& world_;
  Trace& trace_;
  Host host_;
  const bool is_trigger_;
  size_t place_ = 0;
  size_t trigger_place_ = 0;

  // State of the daemon, lost in a crash.
  std::unique_ptr<SimulatedWork> work_;
  std::unique_ptr<control::NodeProtocol> protocol_;
  std::unique_ptr<control::CommandReplayFilter> filter_;
  Duration clock_error_{};
  uint32_t session_ = 0;
  uint32_t sequence_ = 0;
  bus::SessionReplayFilter sessions_;
  bus::SessionChallenges challenges_;
  std::deque<control::CommandReplayFilter::Admitted> commands_;
  int64_t pulse_seq_ = 0;
  bool is_paused_ = false;
  bool is_ending_ = false;
  /// What arrived while the process is paused, in order.
  std::vector<std::function<void()>> waiting_;
  std::map<std::string, int64_t> waiting_of_;  ///< number of frames, by camera, and of "edges"
  int64_t turn_ = 0;  ///< number of the newest planned turn; older plans do nothing
};

}  // namespace v3d::simulation
