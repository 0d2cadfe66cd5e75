#include "trigger/scpi/scpi_generator.h"

#include <algorithm>
#include <utility>

#include "base/core/check.h"

namespace v3d {
namespace {

/// All tries of one command together, what a single transfer may take longer aside.
constexpr Duration kPatience = std::chrono::seconds(6);
constexpr int kTries = 3;  ///< with an instrument that was not unplugged in between
constexpr Duration kBetweenTries = std::chrono::milliseconds(300);
/// The clocks of the instrument and of this host differ by less than one part in so many.
constexpr int64_t kClockPart = 2000;

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

void ScpiGenerator::try_to(const std::function<void()>& work) {
  patience_ = clock_.now() + kPatience;
  bool was_there = false;  // then it will be plugged in again: worth all the patience
  for (int tries = 1;; ++tries) {
    std::string why;
    bool unplugged = false;
    try {
      open_if_closed();
      return work();
    } catch (const InstrumentAbsent& error) {
      was_there = was_there || instrument_;
      unplugged = was_there;
      why = unplugged ? "was unplugged, and is not back" : error.what();
    } catch (const InstrumentError& error) {
      was_there = was_there || instrument_;
      why = error.what();
    }
    instrument_.reset();
    const MonotonicInstant again = clock_.now() + kBetweenTries;
    if (again >= patience_ || (tries >= kTries && !unplugged)) {
      throw InputError(trigger_.instrument.text() + ": " + why);
    }
    clock_.sleep_until(again);
  }
}

void ScpiGenerator::open_if_closed() {
  if (instrument_) return;
  instrument_ = open_(trigger_.instrument);
  std::string name = ask("*IDN?");
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const std::string_view maker : dialect_.makers) {
    if (name.find(maker) != std::string::npos) return;
  }
  throw InstrumentError("is " + in_quotes(name) + ", which does not speak " +
                        std::string(dialect_.name));
}

std::string ScpiGenerator::ask(const std::string& line) {
  refuse_slow();
  return instrument_->query(line);
}

void ScpiGenerator::tell(const std::string& line) {
  refuse_slow();
  if (!dialect_.acknowledges) return instrument_->write(line);
  const std::string answer = instrument_->query(line);
  if (!says(answer, "", "OK")) {
    throw InstrumentError("answers " + line + " with " + in_quotes(answer) + "; right would be ok");
  }
}

void ScpiGenerator::refuse_slow() const {
  if (clock_.now() >= patience_) throw InstrumentError("takes too long for everything");
}

void ScpiGenerator::apply(const std::vector<ScpiSetting>& settings) {
  for (const ScpiSetting& setting : settings) {
    const std::string line = fill_in(setting.set, values_);
    tell(line);
    if (setting.query.empty()) continue;
    const std::string answer = ask(fill_in(setting.query, values_));
    const std::string want = fill_in(setting.want, values_);
    if (says(answer, setting.part, want)) continue;
    throw InstrumentError("was told " + line + " and says " + in_quotes(answer));
  }
}

void ScpiGenerator::refuse_errors() {
  if (dialect_.error_query.empty()) return;
  const std::string answer = ask(std::string(dialect_.error_query));
  if (!says(answer.substr(0, answer.find(',')), "", "0")) {
    throw InstrumentError("has the error " + in_quotes(answer));
  }
}

void ScpiGenerator::close_gate() {
  if (!trigger_.gate || (gate_ && gate_->set(false))) return;
  gate_.reset();
  gate_ = open_line_(*trigger_.gate);
}

void ScpiGenerator::silence() {
  close_gate();
  try_to([this] { turn_off(); });
}

void ScpiGenerator::turn_off() {
  apply(dialect_.off);
  output_on_ = false;
}

void ScpiGenerator::arm(const PulseTrain& train) {
  refuse_impossible(train, trigger_.instrument.text());
  may_run_ = false;
  started_.reset();
  stopped_.reset();
  fault_.clear();
  values_.train = train;
  close_gate();
  try_to([&] { program(train); });
}

void ScpiGenerator::program(const PulseTrain& train) {
  turn_off();
  apply(dialect_.shape);
  apply(train.count ? dialect_.burst : is_gated() ? dialect_.gated : dialect_.endless);
  refuse_errors();
  output_on_ = true;
  apply(dialect_.on);
}

void ScpiGenerator::start() {
  V3D_CHECK(instrument_ && "arm() comes first");
  patience_ = clock_.now() + kPatience;
  may_run_ = true;
  try {
    if (is_gated() && !gate_->set(true)) {
      throw InstrumentError("gate line " + line_text(*trigger_.gate) + " is gone");
    }
    if (!is_gated()) tell(fill_in(dialect_.start, values_));
  } catch (const InstrumentError& error) {
    instrument_.reset();
    throw InputError(trigger_.instrument.text() + ": does not start: " + error.what());
  }
  started_ = clock_.now();
}

void ScpiGenerator::stop() {
  if (!output_on_ || stopped_) return;
  if (gate_ && !gate_->set(false)) fault_ = "gate line " + line_text(*trigger_.gate) + " is gone";
  try {
    try_to([this] { turn_off(); });
  } catch (const InputError& error) {
    if (may_run_) fault_ = std::string("pulses may go on: ") + error.what();
  }
  if (started_) stopped_ = clock_.now();
}

MonotonicInstant ScpiGenerator::end() const {
  const Duration length = *values_.train.count * period_of(values_.train.rate_hz);
  return *started_ + length + length / kClockPart + period_of(values_.train.rate_hz);
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

}  // namespace v3d
