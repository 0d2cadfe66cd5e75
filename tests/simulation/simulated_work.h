// Simulated work of capture and reconstruction nodes. It imitates CaptureNode and ReconNode, whose
// cameras, threads and files cannot be simulated. Decisions are made by the daemons' own classes:
// TrainState, RejoinDecision, KnownPulses, CameraAccount and Ledger.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/captured/pulse_recorder.h"
#include "daemon/control/node_protocol.h"
#include "daemon/node/peer_health.h"
#include "daemon/node/persisted_command.h"
#include "simulation/node_setting.h"

namespace v3d::simulation {

/// Common part of capture and reconstruction nodes. One thread.
class SimulatedWork : public control::NodeDelegate {
 public:
  SimulatedWork(World& world, Host& host)
      : world_(world), host_(host), rejoin_(host.disk.persisted_commands()) {}

  /// Called with accepted health of the trigger's node; on_other_health(): of any node.
  void on_trigger_health(const node::ReceivedHealth& health) { trigger_health_.push_back(health); }
  virtual void on_other_health(const node::ReceivedHealth&) {}
  virtual void on_pulse_message(const wire::PulseMessage&) {}
  /// Called when a camera of this node has delivered the frame of a pulse.
  virtual void on_frame(const std::string&, int64_t) {}
  /// Called when the sense line of this node has seen a pulse.
  virtual void on_sensed(int64_t) {}
  /// True when a full disk caused the last report.
  virtual bool ended_by_disk() const { return false; }
  bool progressed_since(MonotonicInstant) const override { return true; }

 protected:
  MonotonicInstant now() const { return world_.time.now(); }
  /// The take to rejoin, decided from the health received from the trigger's node.
  std::optional<node::RejoinDecision::Found> running_take();
  void listen_to_train();
  void restart_train();
  void clear_persisted_orders();
  TakeOnDisk& on_disk() { return host_.disk.takes.at(order_.take); }
  /// Creates the folder of the take, with the order.
  void create_take(const std::vector<std::string>& cameras);
  void remove_take();
  void reject_existing(const wire::CommandMessage& order) const;

  World& world_;
  Host& host_;
  wire::CommandMessage order_;
  node::TrainState train_;

 private:
  node::RejoinDecision rejoin_;
  std::vector<node::ReceivedHealth> trigger_health_;  ///< not yet processed
};

class SimulatedCapture : public SimulatedWork {
 public:
  SimulatedCapture(World& world, Host& host) : SimulatedWork(world, host) {}

  void arm(const wire::CommandMessage& order) override;
  void learn(const wire::CommandMessage& order) override { make_ready(order); }
  void start() override;
  void drain() override;
  void disarm() override;
  std::optional<wire::CommandMessage> rejoin() override;
  std::optional<control::NodeReport> poll(control::Phase phase) override;
  void report_health(wire::HealthMessage& health) override;

  void on_other_health(const node::ReceivedHealth& health) override;
  void on_pulse_message(const wire::PulseMessage& pulse) override;
  void on_frame(const std::string& camera, int64_t pulse) override;
  void on_sensed(int64_t pulse) override;
  bool ended_by_disk() const override { return ended_by_disk_; }

 private:
  bool records() const { return is_open_ && order_.verb == wire::CommandVerb::kArm; }
  bool is_counted() const { return is_open_ && order_.verb != wire::CommandVerb::kBackground; }
  void make_ready(const wire::CommandMessage& order);
  std::optional<int64_t> train_length() const;
  control::NodeReport poll_arming();
  void open_take();
  std::optional<control::NodeReport> poll_learning();
  std::optional<control::NodeReport> poll_recording();
  std::optional<control::NodeReport> poll_draining();
  bool train_has_ended();
  bool is_drained() const;
  bool has_all(int64_t pulses, bool silent, Duration quiet) const;
  int64_t commanded() const;
  take::Ledger close_take();
  void write(const std::string& camera, int64_t pulse);

  MonotonicInstant ready_at_;
  bool is_ready_ = false;  ///< false: the cameras do not become ready
  bool is_open_ = false;
  bool was_started_ = false;
  MonotonicInstant ended_;
  MonotonicInstant last_frame_;
  MonotonicInstant learn_by_;
  captured::KnownPulses pulses_{"", {}};
  std::map<std::string, take::CameraAccount> accounts_;
  std::map<std::string, int64_t> received_;
  int64_t write_errors_ = 0;
  bool disk_is_full_ = false;  ///< a full disk here ended the last take
  std::map<std::string, node::FullDiskState> other_disks_;  ///< by node; on the trigger's node only
  bool ended_by_disk_ = false;
};

class SimulatedRecon : public SimulatedWork {
 public:
  SimulatedRecon(World& world, Host& host) : SimulatedWork(world, host) {}

  void arm(const wire::CommandMessage& order) override;
  void learn(const wire::CommandMessage& order) override;
  void start() override { restart_train(); }
  void drain() override { drain_began_ = now(); }
  void disarm() override;
  std::optional<wire::CommandMessage> rejoin() override;
  std::optional<control::NodeReport> poll(control::Phase phase) override;
  void report_health(wire::HealthMessage&) override {}
  void on_frame(const std::string& camera, int64_t pulse) override;

 private:
  bool is_open_ = false;
  MonotonicInstant ready_at_;
  MonotonicInstant drain_began_;
};

}  // namespace v3d::simulation
