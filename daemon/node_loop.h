// The loop of a daemon: commands in, replies and health out, the watchdog fed, a clean end.
#pragma once

#include <string>

#include "base/studio_file.h"
#include "daemon/bus.h"
#include "daemon/clock_watch.h"
#include "daemon/control.h"
#include "daemon/machine_health.h"
#include "daemon/node_work.h"

namespace v3d {

class NodeLoop {
 public:
  /// `work` and `bus` outlive the loop. `program` is what health names.
  NodeLoop(std::string node, std::string program, Bus& bus, NodeWork& work);

  /// Runs until stop_requested(), then closes what is open: a take that is being recorded is
  /// drained for at most kLastDrain and left valid.
  void run();

 private:
  void turn();
  void carry_out(const Controller::Step& step);
  void begin(Work work);
  void publish(std::vector<ReplyMessage> replies);
  void publish_health();
  void feed_watchdog();
  void shut_down();

  static constexpr Duration kTurn = std::chrono::milliseconds(20);
  static constexpr Duration kHealthEvery = std::chrono::seconds(1);
  static constexpr Duration kLastDrain = std::chrono::seconds(5);

  const std::string node_;
  const std::string program_;
  Bus& bus_;
  NodeWork& work_;
  Controller controller_;
  Subscription<CommandMessage> commands_;
  MachineHealth machine_;
  ClockWatch clock_;
  int64_t health_seq_ = 0;
  Phase told_phase_ = Phase::kIdle;  ///< by the last health message
  MonotonicInstant next_health_;
  std::optional<Duration> watchdog_;
  MonotonicInstant last_fed_;
};

}  // namespace v3d
