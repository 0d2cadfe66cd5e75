// Pulse generator on a GPIO output line; this host's clock paces the pulses.
#pragma once

#include <memory>

#include "trigger/gpio_line.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d {

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
  PulseStatistics statistics() const override { return train_.statistics(); }
  std::string fault() const override;

 private:
  bool begin_pulse(MonotonicInstant /*at*/) override { return output_->set(true); }
  bool end_pulse() override { return output_->set(false); }
  /// Ends the train and makes the line inactive. Opens the line if it is not open or does not work.
  void request_line(const PacedTrain::Plan& plan);

  const StudioLine line_;
  const OpenOutputLine open_;
  std::unique_ptr<OutputLine> output_;
  PacedTrain train_;  ///< last member: its thread uses the members above
};

}  // namespace v3d
