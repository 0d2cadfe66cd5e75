// Trigger of the simulated studio.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_values.h"
#include "base/core/time.h"
#include "base/io/unique_fd.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

// Client socket of the simulated trigger cable (base/config/studio_values.h).

/// A connected client; owns the socket. After a disconnection the functions report it: they do not
/// block and raise no SIGPIPE. Threads: one caller, except for disconnected().
class TriggerCableClient {
 public:
  /// Throws InputError when no server listens at `path` or the path is too long.
  explicit TriggerCableClient(const std::filesystem::path& path);
  TriggerCableClient(const TriggerCableClient&) = delete;
  TriggerCableClient& operator=(const TriggerCableClient&) = delete;

  /// Returns false when the server has disconnected or does not read.
  bool send(const TriggerEdge& edge);
  /// Waits for the next edge until `deadline`; empty when none came or the server disconnected.
  std::optional<TriggerEdge> receive(MonotonicInstant deadline);
  /// Discards the edges that have arrived.
  void drain();
  bool disconnected() const { return disconnected_; }  ///< any thread

 private:
  /// Receives one edge without waiting.
  std::optional<TriggerEdge> receive_now();

  io::UniqueFd fd_;
  std::atomic<bool> disconnected_ = false;
};

// Generator and sense line of the simulated studio: clients of the socket in
// base/config/studio_values.h.

/// Sends edges on the simulated trigger cable. Edge k is due at start + k * period on
/// CLOCK_MONOTONIC and carries this time as its stamp, also when this host sends it late.
///
/// A hardware generator would be on time, and latencies that are measured from the stamp include
/// the lateness. For the same reason a busy host loses no edge: it sends late edges at once. An
/// edge that is later than 1 s or 100 periods, whichever is less, is skipped and counted.
class SimulatedGenerator : public PulseGenerator, private PulseOutput {
 public:
  explicit SimulatedGenerator(std::filesystem::path wire, HostClock clock = {});
  ~SimulatedGenerator() override;

  /// No effect: the cable is inactive without edges.
  void silence() override {}
  void arm(const PulseTrain& train) override;
  void start() override;
  void stop() override { train_.stop(); }
  int64_t commanded() const override { return train_.commanded(); }
  std::optional<MonotonicInstant> first_pulse() const override { return train_.first_pulse(); }
  bool finished() const override { return train_.finished(); }
  PulseStatistics statistics() const override { return train_.statistics(); }
  std::string fault() const override;
  /// The number of commanded pulses that were skipped because this host was late.
  int64_t skipped() const { return train_.skipped(); }

 private:
  bool begin_pulse(int64_t number, MonotonicInstant at) override;
  bool end_pulse() override { return true; }

  const std::filesystem::path path_;
  std::unique_ptr<TriggerCableClient> cable_;
  PacedTrain train_;  ///< last member: its thread uses the members above
};

/// Reads the edges of the simulated trigger cable.
class SimulatedSensor : public PulseSensor {
 public:
  explicit SimulatedSensor(std::filesystem::path wire);
  ~SimulatedSensor() override;

  void reset() override;
  std::optional<SensedPulse> wait(MonotonicInstant deadline) override;
  std::string fault() const override;

 private:
  const std::filesystem::path path_;
  std::unique_ptr<TriggerCableClient> cable_;
  int64_t next_ = 0;
};

}  // namespace v3d::trigger
