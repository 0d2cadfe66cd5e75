// Pulse generator: a bench signal generator that is programmed with SCPI over USB or a serial port.
#pragma once

#include <memory>
#include <string>

#include "trigger/gpio.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"
#include "trigger/scpi/instrument.h"
#include "trigger/scpi/scpi_dialect.h"

namespace v3d::trigger {

/// A train of known length is a burst, which the instrument counts. A train without end runs while
/// the gate line is active or, without a gate line, until the output is turned off. Its count is an
/// estimate by this host's clock, so a sense line should be used.
///
/// Every setting is read back. After an error the instrument is opened again and the task is
/// repeated, at most three times; then the error is reported in one line. An instrument that was
/// unplugged may be plugged in again within 6 s.
class ScpiGenerator : public PulseGenerator {
 public:
  explicit ScpiGenerator(const StudioTrigger& trigger, OpenInstrument open = open_instrument,
                         OpenOutputLine open_line = open_output_line, HostClock clock = {});
  ~ScpiGenerator() override;

  void silence() override;
  void arm(const PulseTrain& train) override;
  void start() override;
  /// Tries again when an earlier call has failed.
  void stop() override;
  int64_t commanded() const override;
  /// When the start was sent. Instruments raise pulse 0 some to tens of milliseconds later, and not
  /// always after the same delay. The end of the sending is no bound: an instrument that
  /// acknowledges it may raise pulse 0 long before its answer arrives.
  std::optional<MonotonicInstant> first_pulse() const override { return start_sent_; }
  bool finished() const override;
  /// True for a burst that was not stopped early.
  bool counts_exactly() const override {
    return values_.train.count && (!stopped_ || *stopped_ >= end());
  }
  PulseStatistics statistics() const override { return {}; }
  std::string fault() const override { return fault_; }

 private:
  /// Opens the instrument if needed, checks its dialect and calls `work`; repeats this after
  /// errors.
  void with_retries(const std::function<void()>& work);
  void open_if_closed();
  void close_gate();
  void turn_off();
  void program(const PulseTrain& train);
  void apply(const std::vector<ScpiSetting>& settings);
  void send(const std::string& line);
  std::string query(const std::string& line);
  /// Throws InstrumentError after deadline_.
  void check_deadline() const;
  /// Throws InstrumentError when the instrument reports an error.
  void check_error_queue();
  bool is_gated() const { return gate_ && !values_.train.count; }
  /// The time by which the instrument has made the last pulse of a burst, with a margin for its
  /// clock.
  MonotonicInstant end() const;

  const StudioTrigger trigger_;
  const ScpiDialect& dialect_;
  const OpenInstrument open_;
  const OpenOutputLine open_line_;
  const HostClock clock_;
  ScpiValues values_;
  std::unique_ptr<Instrument> instrument_;
  std::unique_ptr<OutputLine> gate_;
  MonotonicInstant deadline_;
  MonotonicInstant off_sent_;  ///< when the output was last turned off
  bool output_on_ = false;     ///< the output may be connected
  bool may_run_ = false;       ///< start() was called since arm()
  std::optional<MonotonicInstant> start_sent_;
  std::optional<MonotonicInstant> started_;  ///< the sending has ended
  std::optional<MonotonicInstant> stopped_;  ///< the pulses have ended, as far as is known
  std::string fault_;
};

}  // namespace v3d::trigger
