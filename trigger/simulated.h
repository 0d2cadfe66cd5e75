// Generator and sense line of the simulated studio: clients of the socket in
// base/core/trigger_edge.h.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"
#include "trigger/wire_socket.h"

namespace v3d {

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
  bool begin_pulse(MonotonicInstant at) override;
  bool end_pulse() override { return true; }

  const std::filesystem::path path_;
  std::unique_ptr<WireSocket> wire_;
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
  std::unique_ptr<WireSocket> wire_;
  int64_t next_ = 0;
};

}  // namespace v3d
