// The generator and the sense line of the simulated studio: clients of base/trigger_wire.h.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "trigger/pulse_generator.h"
#include "trigger/wire_socket.h"

namespace v3d {

inline constexpr double kSimulatedMinRateHz = 0.01;
inline constexpr double kSimulatedMaxRateHz = 1000;

/// How the generator knows and awaits the time; tests have their own.
struct HostClock {
  std::function<MonotonicInstant()> now = Monotonic::now;
  std::function<void(MonotonicInstant)> sleep_until = v3d::sleep_until;
};

/// Edge k stands at start + k * period on CLOCK_MONOTONIC and carries that instant as its stamp,
/// however late this host was in sending it: a generator in hardware would have been on time, and a
/// latency that is measured from the stamp has the lateness in it. The start is when this host was
/// ready to send edge 0. An edge is not sent when the next is due already: it keeps its number, is
/// counted, and told of in fault().
class SimulatedGenerator : public PulseGenerator {
 public:
  explicit SimulatedGenerator(std::filesystem::path wire, HostClock clock = {});
  ~SimulatedGenerator() override;

  void arm(const PulseTrain& train) override;
  void start() override;
  void stop() override;
  int64_t commanded() const override;
  bool finished() const override;
  Duration worst_lateness() const override;
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
  const HostClock clock_;
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
