// Pulse generator and sense line on GPIO lines.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "trigger/gpio_lines.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

using OpenOutputLine = std::function<std::unique_ptr<OutputLine>(const StudioLine&)>;
using OpenInputLine = std::function<std::unique_ptr<InputLine>(const StudioLine&)>;

// Pulse generator on a GPIO output line; this host's clock paces the pulses.

/// Requests the line at the first silence() or arm() and keeps it; the line is inactive between
/// trains.
///
/// A pulse that is later than a quarter of a period is skipped: a camera that is still busy with
/// the previous pulse would miss it, and it would be unknown which cameras missed it.
class GpioGenerator : public PulseGenerator, private PulseOutput {
 public:
  explicit GpioGenerator(StudioLine line, OpenOutputLine open = open_output_line,
                         HostClock clock = {});
  ~GpioGenerator() override;

  void silence() override;
  void arm(const PulseTrain& train) override;
  void start() override;
  void stop() override { train_.stop(); }
  int64_t commanded() const override { return train_.commanded(); }
  std::optional<MonotonicInstant> first_pulse() const override { return train_.first_pulse(); }
  bool finished() const override { return train_.finished(); }
  bool is_paced_by_this_host() const override { return true; }
  PulseStatistics statistics() const override { return train_.statistics(); }
  std::string fault() const override;

 private:
  bool begin_pulse(int64_t /*number*/, MonotonicInstant /*at*/) override {
    return output_->set(true);
  }
  bool end_pulse() override { return output_->set(false); }
  /// Ends the train and makes the line inactive. Opens the line if it is not open or does not work.
  void request_line(const PacedTrain::Plan& plan);

  const StudioLine line_;
  const OpenOutputLine open_;
  std::unique_ptr<OutputLine> output_;
  PacedTrain train_;  ///< last member: its thread uses the members above
};

// Sense line on a GPIO input.

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

}  // namespace v3d::trigger
