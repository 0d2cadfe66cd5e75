// Accounting of the acknowledgements of action commands.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/action_packet.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

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

}  // namespace v3d::trigger
