// Pulses on a GPIO line, paced by this host.
#pragma once

#include <memory>

#include "trigger/gpio_line.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// From the first silence() or arm() on it keeps the line, and keeps it inactive between trains. A
/// pulse later than a quarter of a period is skipped: cameras that are still busy with the one
/// before would miss it, and nobody would know which.
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
  PulseStatistics statistics() const override { return train_.statistics(); }
  std::string fault() const override;

 private:
  bool begin_pulse(MonotonicInstant /*at*/) override { return output_->set(true); }
  bool end_pulse() override { return output_->set(false); }
  /// Ends the train and opens the line anew if it is not open, or gone.
  void take_line(const PacedTrain::Plan& plan);

  const StudioLine line_;
  const OpenOutputLine open_;
  std::unique_ptr<OutputLine> output_;
  PacedTrain train_;  ///< last: its thread uses what stands above
};

}  // namespace v3d
