// The sense line on a GPIO input.
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

/// Reads the line in a thread of its own from the first reset() on, because the kernel keeps only
/// 16 edges. A pulse is told when it has ended, so that its width is known; one whose end is not
/// seen, at the next edge or a second later.
class GpioSensor : public PulseSensor {
 public:
  explicit GpioSensor(StudioLine line, OpenInputLine open = open_input_line);
  ~GpioSensor() override;

  void reset() override;
  std::optional<SensedPulse> wait(MonotonicInstant deadline) override;
  std::string fault() const override;

 private:
  void run();
  void hear(const LineEdge& edge);
  void tell_overdue();
  void tell(std::optional<Duration> width);
  void end_thread();

  const StudioLine line_;
  const OpenInputLine open_;
  std::unique_ptr<InputLine> input_;       ///< the thread's while it runs
  std::optional<MonotonicInstant> begun_;  ///< of a pulse whose end was not seen yet; the thread's
  std::thread thread_;
  std::atomic<bool> stopping_ = false;

  mutable std::mutex mutex_;  ///< everything below
  std::condition_variable changed_;
  std::deque<SensedPulse> pulses_;
  int64_t next_ = 0;
  bool gone_ = false;
  int64_t dropped_ = 0;
};

}  // namespace v3d
