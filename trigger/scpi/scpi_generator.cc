#include "trigger/scpi/scpi_generator.h"

#include <algorithm>
#include <utility>

#include "base/core/error.h"

namespace v3d::trigger {
namespace {

/// Time limit for all attempts of one task. The last transfer may exceed it.
constexpr Duration kCommandTimeout = std::chrono::seconds(6);
constexpr int kMaxAttempts = 3;  ///< for an instrument that is neither unplugged meanwhile nor busy
constexpr Duration kRetryInterval = std::chrono::milliseconds(300);
/// The clocks of the instrument and of this host differ by less than 1 in kClockToleranceDivisor.
constexpr int64_t kClockToleranceDivisor = 2000;

}  // namespace

ScpiGenerator::ScpiGenerator(const StudioTrigger& trigger, OpenInstrument open,
                             OpenOutputLine open_line, HostClock clock)
    : trigger_(trigger),
      dialect_(scpi_dialect(trigger.dialect)),
      open_(std::move(open)),
      open_line_(std::move(open_line)),
      clock_(std::move(clock)) {
  values_.channel = trigger.channel;
  values_.high_v = trigger.level_v;
}

ScpiGenerator::~ScpiGenerator() { stop(); }

void ScpiGenerator::with_retries(const std::function<void()>& work) {
  deadline_ = clock_.now() + kCommandTimeout;
  bool was_present = false;
  for (int attempt = 1;; ++attempt) {
    std::string reason;
    bool may_return = false;  // wait until the deadline
    try {
      open_if_closed();
      return work();
    } catch (const InstrumentAbsent& error) {
      was_present = was_present || instrument_;
      may_return = was_present;
      reason = was_present ? "was unplugged and was not plugged in again" : error.what();
    } catch (const InstrumentBusy& error) {
      may_return = true;
      reason = error.what();
    } catch (const InstrumentError& error) {
      was_present = was_present || instrument_;
      reason = error.what();
    }
    instrument_.reset();
    const MonotonicInstant next_attempt = clock_.now() + kRetryInterval;
    if (next_attempt >= deadline_ || (attempt >= kMaxAttempts && !may_return)) {
      throw InputError(trigger_.instrument.text() + ": " + reason);
    }
    clock_.sleep_until(next_attempt);
  }
}

void ScpiGenerator::open_if_closed() {
  if (instrument_) return;
  instrument_ = open_(trigger_.instrument);
  std::string name = query("*IDN?");
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const std::string_view maker : dialect_.makers) {
    if (name.find(maker) != std::string::npos) return;
  }
  throw InstrumentError("identifies itself as " + in_quotes(name) +
                        ", which does not support the dialect " + std::string(dialect_.name));
}

std::string ScpiGenerator::query(const std::string& line) {
  check_deadline();
  return instrument_->query(line);
}

void ScpiGenerator::send(const std::string& line) {
  check_deadline();
  if (!dialect_.acknowledges) return instrument_->write(line);
  const std::string answer = instrument_->query(line);
  if (!answer_matches(answer, "", "OK")) {
    throw InstrumentError("answers " + line + " with " + in_quotes(answer) + "; expected ok");
  }
}

void ScpiGenerator::check_deadline() const {
  if (clock_.now() >= deadline_) throw InstrumentError("is too slow: not done within 6 s");
}

void ScpiGenerator::apply(const std::vector<ScpiSetting>& settings) {
  for (const ScpiSetting& setting : settings) {
    const std::string line = substitute_values(setting.set, values_);
    send(line);
    if (setting.query.empty()) continue;
    const std::string answer = query(substitute_values(setting.query, values_));
    const std::string expected = substitute_values(setting.expected, values_);
    if (answer_matches(answer, setting.field, expected, setting.is_count())) continue;
    throw InstrumentError("did not accept " + line + ": it reports " + in_quotes(answer));
  }
}

void ScpiGenerator::check_error_queue() {
  if (dialect_.error_query.empty()) return;
  const std::string answer = query(std::string(dialect_.error_query));
  if (!answer_matches(answer.substr(0, answer.find(',')), "", "0")) {
    throw InstrumentError("reports the error " + in_quotes(answer));
  }
}

void ScpiGenerator::close_gate() {
  if (!trigger_.gate || (gate_ && gate_->set(false))) return;
  gate_.reset();
  gate_ = open_line_(*trigger_.gate);
}

void ScpiGenerator::silence() {
  close_gate();
  with_retries([this] { turn_off(); });
}

void ScpiGenerator::turn_off() {
  off_sent_ = clock_.now();
  apply(dialect_.off);
  output_on_ = may_run_ = false;
  fault_.clear();
}

void ScpiGenerator::arm(const PulseTrain& train) {
  check_train(train, trigger_.instrument.text());
  start_sent_.reset();
  started_.reset();
  stopped_.reset();
  values_.train = train;
  close_gate();
  with_retries([&] { program(train); });
}

void ScpiGenerator::program(const PulseTrain& train) {
  turn_off();
  apply(dialect_.shape);
  apply(train.count ? dialect_.burst : is_gated() ? dialect_.gated : dialect_.endless);
  check_error_queue();
  output_on_ = true;
  apply(dialect_.on);
}

void ScpiGenerator::start() {
  V3D_CHECK(instrument_ && "arm() comes first");
  const MonotonicInstant before = clock_.now();
  deadline_ = before + kCommandTimeout;
  may_run_ = true;
  try {
    if (is_gated() && !gate_->set(true)) {
      throw InstrumentError("gate line " + line_text(*trigger_.gate) + " is gone");
    }
    if (!is_gated()) send(substitute_values(dialect_.start, values_));
  } catch (const InstrumentError& error) {
    instrument_.reset();
    throw InputError(trigger_.instrument.text() + ": does not start: " + error.what());
  }
  start_sent_ = before;
  started_ = clock_.now();
}

void ScpiGenerator::stop() {
  if (!output_on_) return;
  std::string fault;
  if (gate_ && !gate_->set(false)) fault = "gate line " + line_text(*trigger_.gate) + " is gone";
  const MonotonicInstant gate_closed = clock_.now();
  const bool is_gate_closed = is_gated() && fault.empty();
  try {
    with_retries([this] { turn_off(); });
  } catch (const InputError& error) {
    if (may_run_) fault = std::string(kPulsesMayContinue) + ": " + error.what();
  }
  fault_ = fault;
  // The answers to the commands come after the last pulse.
  if (started_ && !stopped_) {
    stopped_ = is_gate_closed ? gate_closed : output_on_ ? clock_.now() : off_sent_;
  }
}

MonotonicInstant ScpiGenerator::end() const {
  const Duration length = *values_.train.count * period_of(values_.train.rate_hz);
  return *started_ + length + length / kClockToleranceDivisor + period_of(values_.train.rate_hz);
}

int64_t ScpiGenerator::commanded() const {
  if (!started_) return 0;
  const Duration ran = stopped_.value_or(clock_.now()) - *started_;
  const int64_t passed = ran / period_of(values_.train.rate_hz) + 1;
  return std::min(passed, values_.train.count.value_or(passed));
}

bool ScpiGenerator::finished() const {
  if (!started_ || stopped_) return true;
  return values_.train.count && clock_.now() >= end();
}

}  // namespace v3d::trigger
