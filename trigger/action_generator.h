// Pulse generator without cables: action commands of GigE Vision, and their acknowledgements.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/action_packet.h"
#include "base/io/unique_fd.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

// Accounting of the acknowledgements of action commands.

/// Counts since the last reset().
struct AcknowledgementCounts {
  int64_t acknowledged = 0;  ///< in time, with success; sum over the cameras
  int64_t missing = 0;       ///< none came before the deadline; sum over the cameras
  int64_t rejected = 0;      ///< in time, with another status; sum over the cameras
  int64_t repeated = 0;      ///< a camera had acknowledged the command before
  int64_t late = 0;          ///< after the deadline, or of a command that was not sent
  int64_t foreign = 0;       ///< from an address that no camera has
  friend bool operator==(const AcknowledgementCounts&, const AcknowledgementCounts&) = default;
};

/// Compares acknowledgements with the commands that were sent, by request number and address.
///
/// A pulse is sensed when at least one camera acknowledges its command in time, with success. Its
/// time is that of the command. Pulses are returned in their order, so a pulse without an
/// acknowledgement delays the next ones, at most until its deadline. Thread-safe.
class ActionAcknowledgements {
 public:
  /// An acknowledgement that arrives later than this after the time of its pulse is late. A busy PC
  /// reads them late; PulseTimes::kMaxSenseDelay is the limit.
  static constexpr Duration kDeadline = std::chrono::milliseconds(200);

  /// The addresses are IPv4.
  explicit ActionAcknowledgements(std::vector<ActionCamera> cameras);

  /// Forgets all commands and restarts the counts at 0.
  void reset();
  /// A command was sent for the pulse `number` at `at`. Numbers and times increase, and no two
  /// commands whose deadline is not over have the same request number.
  void sent(int64_t number, uint16_t request, MonotonicInstant at);
  /// An acknowledgement has arrived. `address`: IPv4 address of the sender, most significant byte
  /// first in the number.
  void received(uint32_t address, const io::ActionAcknowledgement& acknowledgement,
                MonotonicInstant now);
  /// Counts what is missing of the commands whose deadline is over.
  void expire(MonotonicInstant now);
  /// The next sensed pulse whose time has come. Waits until `deadline`; empty when there is none.
  std::optional<SensedPulse> wait(MonotonicInstant deadline);

  AcknowledgementCounts counts() const;
  /// Missing and rejected acknowledgements with the names of the cameras, one line; else empty.
  std::string warning() const;

 private:
  struct Camera {
    std::string name;
    uint32_t address = 0;
    int64_t missing = 0;
    int64_t rejected = 0;
    io::ActionStatus last_rejection = io::ActionStatus::kSuccess;
  };
  struct Command {
    int64_t number = 0;
    uint16_t request = 0;
    MonotonicInstant at;
    std::vector<bool> answered;  ///< by camera
    bool sensed = false;
    bool is_reported = false;  ///< its pulse is in ready_, or is known to be not sensed
  };
  /// Moves sensed pulses to ready_ and removes the commands whose deadline is over.
  void advance(MonotonicInstant now);
  /// The time at which advance() may change something, at most `deadline`.
  MonotonicInstant next_change(MonotonicInstant deadline) const;

  mutable std::mutex mutex_;  ///< guards the next members
  std::condition_variable changed_;
  std::vector<Camera> cameras_;
  std::deque<Command> commands_;  ///< with a deadline that is not over
  std::deque<SensedPulse> ready_;
  AcknowledgementCounts counts_;
};

// The generator.

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
