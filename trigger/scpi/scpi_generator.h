// Pulses of a signal generator that is programmed over USB or a serial port.
#pragma once

#include <memory>
#include <string>

#include "trigger/gpio_line.h"
#include "trigger/host_clock.h"
#include "trigger/pulse_generator.h"
#include "trigger/scpi/instrument.h"
#include "trigger/scpi/scpi_dialect.h"

namespace v3d {

/// A train of known length is a burst, which the instrument counts. A train without end runs while
/// the gate line is active, where there is one, and otherwise until the output is turned off; its
/// count is an estimate by this host's clock, so a sense line should stand beside it. Every setting
/// is read back. Everything that is wrong with the instrument is tried again, from opening it on,
/// and then said in one line; one that is unplugged may come back within some seconds.
class ScpiGenerator : public PulseGenerator {
 public:
  explicit ScpiGenerator(const StudioTrigger& trigger, OpenInstrument open = open_instrument,
                         OpenOutputLine open_line = open_output_line, HostClock clock = {});
  ~ScpiGenerator() override;

  void silence() override;
  void arm(const PulseTrain& train) override;
  void start() override;
  void stop() override;
  int64_t commanded() const override;
  std::optional<MonotonicInstant> first_pulse() const override { return started_; }
  bool finished() const override;
  /// A burst that was not broken off.
  bool counts_exactly() const override {
    return values_.train.count && (!stopped_ || *stopped_ >= end());
  }
  PulseStatistics statistics() const override { return {}; }
  std::string fault() const override { return fault_; }

 private:
  /// Does `work` with the instrument open and known to be of the dialect; again, if it fails.
  void try_to(const std::function<void()>& work);
  void open_if_closed();
  void close_gate();
  void turn_off();
  void program(const PulseTrain& train);
  void apply(const std::vector<ScpiSetting>& settings);
  void tell(const std::string& line);
  std::string ask(const std::string& line);
  void refuse_slow() const;
  void refuse_errors();
  bool is_gated() const { return gate_ && !values_.train.count; }
  /// When the instrument has surely made the last pulse of a burst, its clock being what it is.
  MonotonicInstant end() const;

  const StudioTrigger trigger_;
  const ScpiDialect& dialect_;
  const OpenInstrument open_;
  const OpenOutputLine open_line_;
  const HostClock clock_;
  ScpiValues values_;
  std::unique_ptr<Instrument> instrument_;
  std::unique_ptr<OutputLine> gate_;
  MonotonicInstant patience_;
  bool output_on_ = false;  ///< connected, or perhaps
  bool may_run_ = false;    ///< it was told to start
  std::optional<MonotonicInstant> started_;
  std::optional<MonotonicInstant> stopped_;
  std::string fault_;
};

}  // namespace v3d
