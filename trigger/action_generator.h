// Pulse generator without cables: action commands of GigE Vision.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "base/config/studio_file.h"
#include "base/io/unique_fd.h"
#include "trigger/action_acknowledgements.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

/// Reads the clock that counts like the PTP clock of the cameras: nanoseconds since its epoch.
using PtpNow = std::function<int64_t()>;

/// Broadcasts one action command for each pulse.
///
/// The command of a pulse is sent `lead_ms`, at most half a period, before the pulse and has its
/// time on the PTP clock. The time is that of this host (CLOCK_TAI or CLOCK_REALTIME), which must
/// follow the PTP clock of the cameras. The difference of this clock and CLOCK_MONOTONIC is
/// measured once, at the start of a train, so the pulses are evenly spaced. Without a common clock
/// (set_clock_fault()) the commands have no time and are sent when the pulse is due.
///
/// A command that is later than half of the lead, or without a time a quarter of a period, is
/// skipped. A missing acknowledgement, and a command that cannot be sent, end no train; they are
/// counted. Threads: that of the train, and one that receives acknowledgements, from arm() on.
class ActionGenerator : public PulseGenerator, private PulseOutput {
 public:
  /// `ptp_now`: for tests; by default it reads the clock of `action`.
  explicit ActionGenerator(StudioAction action, PtpNow ptp_now = {});
  ~ActionGenerator() override;

  /// No effect: cameras expose only at a command.
  void silence() override {}
  /// Throws InputError also when there is no route to the broadcast address.
  void arm(const PulseTrain& train) override;
  void set_clock_fault(const std::string& fault) override { clock_fault_ = fault; }
  void start() override;
  /// Waits for the time of the last command, at most `lead_ms`.
  void stop() override;
  /// Commands that were sent: up to `lead_ms` more than pulses whose time has passed.
  int64_t commanded() const override { return train_.commanded(); }
  /// The number of commands that were skipped, because this host was late.
  int64_t skipped() const { return train_.skipped(); }
  std::optional<MonotonicInstant> first_pulse() const override;
  bool finished() const override;
  PulseStatistics statistics() const override;
  std::string fault() const override;
  std::string warning() const override;
  std::unique_ptr<PulseSensor> own_sensor() override;

 private:
  bool begin_pulse(int64_t number, MonotonicInstant at) override;
  bool end_pulse() override { return true; }
  bool is_scheduled() const { return clock_fault_.empty(); }
  /// The time from a command to its pulse.
  Duration lead() const;
  /// PTP time minus CLOCK_MONOTONIC, ns.
  int64_t measure_offset() const;
  void open_socket();
  void receive();
  void stop_receiver();

  const StudioAction action_;
  const PtpNow ptp_now_;
  const std::shared_ptr<ActionAcknowledgements> acknowledgements_;
  PulseTrain plan_;
  std::string clock_fault_;  ///< why commands have no time; empty: they have one
  io::UniqueFd socket_;
  std::thread receiver_;
  std::atomic<bool> stopping_ = false;

  mutable std::mutex mutex_;  ///< guards the next members
  std::optional<int64_t> offset_ns_;
  MonotonicInstant last_pulse_{};
  int64_t unsent_ = 0;
  std::string send_error_;  ///< of the last command that could not be sent
  bool clock_was_set_ = false;

  PacedTrain train_;  ///< last member: its thread uses the members above
};

}  // namespace v3d::trigger
