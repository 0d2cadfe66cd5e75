// The generator and the sense line of the simulated studio: clients of base/core/trigger_edge.h.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"
#include "trigger/wire_socket.h"

namespace v3d {

/// Edge k stands at start + k * period on CLOCK_MONOTONIC and carries that instant as its stamp,
/// however late this host was in sending it: a generator in hardware would have been on time, and a
/// latency that is measured from the stamp has the lateness in it. For the same reason a busy host
/// loses no edge: late edges are sent at once, one behind the other. An edge that is later than one
/// second, or than 100 periods if that is less, is not sent, and counted as skipped.
class SimulatedGenerator : public PulseGenerator, private PulseOutput {
 public:
  explicit SimulatedGenerator(std::filesystem::path wire, HostClock clock = {});
  ~SimulatedGenerator() override;

  /// A cable that nobody drives is inactive.
  void silence() override {}
  void arm(const PulseTrain& train) override;
  void start() override;
  void stop() override { train_.stop(); }
  int64_t commanded() const override { return train_.commanded(); }
  std::optional<MonotonicInstant> first_pulse() const override { return train_.first_pulse(); }
  bool finished() const override { return train_.finished(); }
  PulseStatistics statistics() const override { return train_.statistics(); }
  std::string fault() const override;
  /// Of commanded(), the pulses that this host was too late to make.
  int64_t skipped() const { return train_.skipped(); }

 private:
  bool begin_pulse(MonotonicInstant at) override;
  bool end_pulse() override { return true; }

  const std::filesystem::path path_;
  std::unique_ptr<WireSocket> wire_;
  PacedTrain train_;  ///< last: its thread uses what stands above
};

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
