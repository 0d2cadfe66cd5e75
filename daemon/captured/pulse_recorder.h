// Every pulse of a take, as the sense line saw it: numbered, published, written, counted.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "capture/sync/train_start.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/known_pulses.h"
#include "daemon/captured/pulse_log.h"
#include "daemon/node/heartbeat.h"
#include "take/ledger/ledger.h"
#include "trigger/pulse_generator.h"
#include "trigger/sensed_train.h"

namespace v3d {

/// On the node of the trigger: reads the sense line and tells the studio. Elsewhere: listens to
/// what that node tells. Has a thread of its own; lives from arming to the end of the take.
class PulseRecorder {
 public:
  /// Of a take that goes on, which this node was in before it was started anew.
  struct Past {
    PulseSet sensed;        ///< pulses in the log
    int64_t commanded = 0;  ///< pulses of the train until now, or a little fewer
  };
  struct Setup {
    std::string take;
    PulseTrain train;                               ///< what was commanded
    std::filesystem::path log{};                    ///< not written where empty
    std::function<void(const PulseEdge&)> on_edge;  ///< called by the thread for every pulse
    std::optional<Past> past{};                     ///< the log goes on
  };
  /// `sensor` (may be null: listen on the bus) is reset here and read until destruction; it and
  /// `bus` outlive the recorder. Throws InputError when the line cannot be reached or the log
  /// cannot be made.
  PulseRecorder(PulseSensor* sensor, Bus& bus, Setup setup);
  ~PulseRecorder();
  PulseRecorder(const PulseRecorder&) = delete;
  PulseRecorder& operator=(const PulseRecorder&) = delete;

  int64_t sensed() const;
  /// What the ledger has of it. `commanded`: pulses until now.
  void put_into(Ledger& ledger, int64_t commanded) const;
  /// "2 extra pulses, 1 runt pulse", or nothing.
  std::string trouble() const;
  /// The highest pulse number seen, plus one.
  int64_t seen() const;
  /// Ends the recording.
  void close();
  /// After close(): PulseLog::lost() and PulseLog::is_kept(); 0 and true without a log.
  int64_t lost_in_log() const { return log_ ? log_->lost() : 0; }
  bool is_kept() const { return !log_ || log_->is_kept(); }
  /// Messages of the trigger's node that did not arrive here; 0 on that node.
  int64_t lost() const { return heard_ ? heard_->counts().lost : 0; }
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.since(since); }

 private:
  void run();
  std::optional<PulseMessage> next();
  /// By this host's clock.
  PulseEdge edge_of(const PulseMessage& pulse) const;
  std::optional<PulseMessage> sense();
  std::optional<PulseMessage> hear();
  void record(const PulseMessage& pulse);
  void say_again();

  PulseSensor* const sensor_;
  Bus& bus_;
  const std::string take_;
  const std::function<void(const PulseEdge&)> on_edge_;
  std::unique_ptr<Subscription<PulseMessage>> heard_;
  std::optional<PulseLog> log_;
  int64_t seq_ = 0;
  std::vector<uint8_t> last_said_;  ///< the recorder's thread only, as is the next
  int to_say_again_ = 0;
  Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  mutable std::mutex mutex_;  ///< what was sensed
  SensedTrain numbers_;
  KnownPulses known_;
  std::thread thread_;
};

}  // namespace v3d
