// The generator and the sense line of the simulated studio: clients of base/trigger_wire.h.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "trigger/pulse_generator.h"

namespace v3d {

class WireSocket;

inline constexpr double kSimulatedMinRateHz = 0.01;
inline constexpr double kSimulatedMaxRateHz = 1000;

/// Edge k stands at start + k * period on CLOCK_MONOTONIC and carries that instant as its stamp,
/// however late this host was in sending it. An edge more than half a period late is not sent, so
/// that no two edges come close together: it is counted, and told of in fault().
class SimulatedGenerator : public PulseGenerator {
 public:
  explicit SimulatedGenerator(std::filesystem::path wire);
  ~SimulatedGenerator() override;

  void arm(const PulseTrain& train) override;
  void start() override;
  void stop() override;
  int64_t commanded() const override;
  bool finished() const override;
  std::string fault() const override;
  /// Of commanded(), the pulses that this host was too late to make.
  int64_t skipped() const;

 private:
  void run(MonotonicInstant first);
  /// Returns false when the train is over.
  bool pulse(int64_t number, MonotonicInstant at);
  /// False when stopped.
  bool wait_for(MonotonicInstant instant) const;
  void join();

  const std::filesystem::path path_;
  PulseTrain train_;
  Duration period_{};
  std::unique_ptr<WireSocket> wire_;
  std::thread thread_;

  mutable std::mutex mutex_;  ///< everything below, and sending an edge
  bool stopped_ = true;
  int64_t commanded_ = 0;
  int64_t skipped_ = 0;
  Duration latest_{};
  bool vanished_ = false;
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
