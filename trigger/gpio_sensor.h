// Sense line on a GPIO input.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

#include "trigger/gpio_line.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// Reads the line on a thread of its own, because the kernel keeps only 16 edges. The first reset()
/// starts the thread.
///
/// A pulse is reported at its end, with its width. A pulse whose end was lost is reported without a
/// width, at the start of the next pulse or after 1.1 s.
class GpioSensor : public PulseSensor {
 public:
  explicit GpioSensor(StudioLine line, OpenInputLine open = open_input_line);
  ~GpioSensor() override;

  void reset() override;
  std::optional<SensedPulse> wait(MonotonicInstant deadline) override;
  std::string fault() const override;

 private:
  void run();
  void on_edge(const LineEdge& edge);
  /// Reports a pulse whose end did not come within kMaxPulseWidth.
  void report_overdue();
  void report(std::optional<Duration> width);
  void stop_thread();

  const StudioLine line_;
  const OpenInputLine open_;
  std::unique_ptr<InputLine> input_;  ///< used by the thread only, while it runs
  std::optional<MonotonicInstant>
      pulse_start_;  ///< of a pulse without an end yet; used by the thread only
  std::thread thread_;
  std::atomic<bool> stopping_ = false;

  mutable std::mutex mutex_;  ///< guards the next members
  std::condition_variable changed_;
  std::deque<SensedPulse> pulses_;
  int64_t next_number_ = 0;
  bool gone_ = false;
  int64_t dropped_ = 0;
};

}  // namespace v3d
