#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "slow_host.h"
#include "support/fake_generator.h"
#include "support/message_of.h"
#include "trigger/scpi/scpi_generator.h"

namespace v3d::trigger {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::FakeGenerator;
using testing::HasSubstr;

/// A fake generator and the faults of its connection.
struct Bench {
  explicit Bench(const std::string& dialect) : generator(dialect) {}

  FakeGenerator generator;
  SlowHost host;
  int64_t opened = 0;
  int64_t absent_for = 0;        ///< number of opens that fail at first
  int64_t unplugged_after = -1;  ///< number of lines until it is unplugged; -1: never
  std::map<std::string, std::string> invalid_answers;  ///< invalid answers, by query
  Duration answer_takes{};

  std::unique_ptr<Instrument> open();
};

class ScriptedInstrument : public Instrument {
 public:
  explicit ScriptedInstrument(Bench& bench) : bench_(bench) {}
  void write(const std::string& line) override { handle(line); }
  std::string query(const std::string& line) override {
    const auto answer = handle(line);
    if (bench_.invalid_answers.contains(line)) return bench_.invalid_answers[line];
    if (!answer) throw InstrumentError("does not answer");
    return *answer;
  }

 private:
  std::optional<std::string> handle(const std::string& line) {
    bench_.host.now += bench_.answer_takes;
    if (bench_.unplugged_after == 0) throw InstrumentAbsent("was unplugged");
    if (bench_.unplugged_after > 0) --bench_.unplugged_after;
    return bench_.generator.process(line);
  }
  Bench& bench_;
};

std::unique_ptr<Instrument> Bench::open() {
  if (++opened <= absent_for) throw InstrumentAbsent("no such instrument on USB");
  return std::make_unique<ScriptedInstrument>(*this);
}

struct Named {
  std::string name;
  Dialect dialect;
};
const std::vector<Named> kDialects = {{"keysight33500", Dialect::kKeysight33500},
                                      {"rigol-dg", Dialect::kRigolDg},
                                      {"siglent-sdg", Dialect::kSiglentSdg},
                                      {"bnc575", Dialect::kBnc575}};

StudioTrigger trigger_of(Dialect dialect) {
  StudioTrigger trigger;
  trigger.kind = TriggerKind::kScpi;
  trigger.instrument = {.vendor = 0x0957, .product = 0x2c07};
  trigger.dialect = dialect;
  return trigger;
}

std::unique_ptr<ScpiGenerator> generator_on(Bench& bench, const StudioTrigger& trigger,
                                            const OpenOutputLine& open_line = open_output_line) {
  return std::make_unique<ScpiGenerator>(
      trigger, [&](const StudioInstrument&) { return bench.open(); }, open_line,
      bench.host.clock());
}

PulseTrain train_of(std::optional<int64_t> count) {
  return {.rate_hz = 25, .width = milliseconds(1), .count = count};
}

TEST(ScpiGenerator, makes_a_burst_of_the_requested_length_in_every_dialect) {
  for (const Named& d : kDialects) {
    SCOPED_TRACE(d.name);
    Bench bench(d.name);
    const auto generator = generator_on(bench, trigger_of(d.dialect));
    generator->arm(train_of(250));
    EXPECT_EQ(bench.generator.pulses, 0);
    EXPECT_NEAR(bench.generator.rate_hz(), 25, 1e-9);
    EXPECT_NEAR(bench.generator.width_s(), 1e-3, 1e-12);
    generator->start();
    EXPECT_EQ(bench.generator.pulses, 250);
    EXPECT_TRUE(bench.generator.output_on());
    EXPECT_FALSE(generator->finished());
    bench.host.now += milliseconds(100);
    EXPECT_EQ(generator->commanded(), 3);
    bench.host.now += seconds(11);
    EXPECT_TRUE(generator->finished());
    generator->stop();
    EXPECT_FALSE(bench.generator.output_on());
    EXPECT_EQ(generator->commanded(), 250);
    EXPECT_TRUE(generator->counts_exactly());
    EXPECT_EQ(generator->fault(), "");
  }
}

TEST(ScpiGenerator, has_its_first_pulse_not_after_the_instrument_received_the_start) {
  for (const Named& d : kDialects) {
    SCOPED_TRACE(d.name);
    Bench bench(d.name);
    const auto generator = generator_on(bench, trigger_of(d.dialect));
    generator->arm(train_of(250));
    EXPECT_FALSE(generator->first_pulse());
    bench.answer_takes = milliseconds(18);
    const MonotonicInstant before = bench.host.now;
    generator->start();
    EXPECT_EQ(generator->first_pulse(), before);
    generator->arm(train_of(250));
    EXPECT_FALSE(generator->first_pulse());
  }
}

TEST(ScpiGenerator, runs_without_end_until_it_is_stopped_and_reports_an_estimated_count) {
  for (const Named& d : kDialects) {
    SCOPED_TRACE(d.name);
    Bench bench(d.name);
    const auto generator = generator_on(bench, trigger_of(d.dialect));
    generator->arm(train_of({}));
    EXPECT_EQ(bench.generator.pulses, 0);
    generator->start();
    EXPECT_EQ(bench.generator.pulses, -1);
    bench.host.now += seconds(3600);
    EXPECT_FALSE(generator->finished());
    generator->stop();
    EXPECT_EQ(bench.generator.pulses, 0);
    EXPECT_TRUE(generator->finished());
    EXPECT_FALSE(generator->counts_exactly());
  }
}

TEST(ScpiGenerator, does_not_count_the_time_of_switching_the_output_off) {
  for (const Named& d : kDialects) {
    SCOPED_TRACE(d.name);
    Bench bench(d.name);
    const auto generator = generator_on(bench, trigger_of(d.dialect));
    generator->arm(train_of({}));
    generator->start();
    bench.answer_takes = milliseconds(100);
    bench.host.now += seconds(3600);
    generator->stop();
    EXPECT_EQ(generator->commanded(), 90'001);
  }
}

/// Stores the level of the gate line in a variable.
class GateLine : public OutputLine {
 public:
  explicit GateLine(bool& active) : active_(active) {}
  bool set(bool active) override {
    active_ = active;
    return true;
  }

 private:
  bool& active_;
};

TEST(ScpiGenerator, counts_until_the_gate_line_is_closed) {
  Bench bench("bnc575");
  bool gate = false;
  StudioTrigger trigger = trigger_of(Dialect::kBnc575);
  trigger.gate = StudioLine{.chip = "gpiochip0", .line = "GATE"};
  const auto generator = generator_on(
      bench, trigger, [&](const StudioLine&) { return std::make_unique<GateLine>(gate); });
  generator->arm(train_of({}));
  generator->start();
  bench.host.now += seconds(3600);
  bench.unplugged_after = 0;
  generator->stop();
  EXPECT_EQ(generator->commanded(), 90'001) << "the instrument did not answer for 6 s";
}

TEST(ScpiGenerator, opens_the_gate_line_for_a_train_without_end) {
  for (const Named& d : kDialects) {
    SCOPED_TRACE(d.name);
    Bench bench(d.name);
    bool gate = true;
    StudioTrigger trigger = trigger_of(d.dialect);
    trigger.gate = StudioLine{.chip = "gpiochip0", .line = "GATE"};
    const auto generator = generator_on(
        bench, trigger, [&](const StudioLine&) { return std::make_unique<GateLine>(gate); });
    generator->arm(train_of({}));
    EXPECT_TRUE(bench.generator.output_on());
    generator->silence();
    EXPECT_FALSE(gate);
    generator->arm(train_of({}));
    generator->start();
    EXPECT_TRUE(gate);
    generator->stop();
    EXPECT_FALSE(gate);
    EXPECT_FALSE(bench.generator.output_on());
  }
}

std::string refusal(ScpiGenerator& generator) {
  return test::message_of<InputError>([&] { generator.arm(train_of(10)); });
}

TEST(ScpiGenerator, rejects_an_instrument_that_does_not_accept_a_setting) {
  Bench bench("rigol-dg");
  bench.generator.lies = ":SOUR1:FUNC:PULS:WIDT";
  const auto generator = generator_on(bench, trigger_of(Dialect::kRigolDg));
  EXPECT_EQ(refusal(*generator),
            "usb:0957:2c07: did not accept :SOUR1:FUNC:PULS:WIDT 0.001: it reports '0'");
  Bench siglent("siglent-sdg");
  siglent.generator.lies = "C1:BTWV TIME";
  const auto other = generator_on(siglent, trigger_of(Dialect::kSiglentSdg));
  EXPECT_THAT(refusal(*other),
              HasSubstr("did not accept C1:BTWV TIME,10: it reports 'C1:BTWV GATE_NCYC"));
}

TEST(ScpiGenerator, rejects_an_instrument_that_shortens_a_long_burst_by_a_few_pulses) {
  for (const Named& d : kDialects) {
    SCOPED_TRACE(d.name);
    Bench bench(d.name);
    bench.generator.max_count = 1'000'000;
    const auto generator = generator_on(bench, trigger_of(d.dialect));
    EXPECT_THAT(test::message_of<InputError>([&] { generator->arm(train_of(1'000'050)); }),
                HasSubstr("1000050: it reports '"));
    generator->arm(train_of(1'000'000));
    generator->start();
    EXPECT_EQ(bench.generator.pulses, 1'000'000);
  }
}

TEST(ScpiGenerator, rejects_an_instrument_of_another_make_and_invalid_answers) {
  Bench bench("keysight33500");
  const auto generator = generator_on(bench, trigger_of(Dialect::kRigolDg));
  EXPECT_THAT(refusal(*generator), HasSubstr("which does not support the dialect rigol-dg"));
  Bench invalid("keysight33500");
  for (const std::string answer : {"", "\x01\xff", "nan", "25 parsec", "1e999", ","}) {
    invalid.invalid_answers["SOUR1:FREQ?"] = answer;
    const auto other = generator_on(invalid, trigger_of(Dialect::kKeysight33500));
    EXPECT_THAT(refusal(*other), HasSubstr("did not accept SOUR1:FREQ 25: it reports '"));
  }
  Bench bnc("bnc575");
  bnc.invalid_answers[":PULSE0:PER 0.04"] = "?4";
  const auto serial = generator_on(bnc, trigger_of(Dialect::kBnc575));
  EXPECT_THAT(refusal(*serial), HasSubstr("answers :PULSE0:PER 0.04 with '?4'"));
}

TEST(ScpiGenerator, reports_an_error_of_the_instrument) {
  Bench bench("keysight33500");
  bench.invalid_answers["SYST:ERR?"] = "-221,\"Settings conflict\"";
  const auto generator = generator_on(bench, trigger_of(Dialect::kKeysight33500));
  EXPECT_THAT(refusal(*generator), HasSubstr("reports the error '-221"));
  EXPECT_FALSE(bench.generator.output_on());
}

TEST(ScpiGenerator, retries_when_the_instrument_is_unplugged_for_a_moment_during_arm) {
  for (int lines = 0; lines < 25; ++lines) {
    Bench bench("siglent-sdg");
    bench.unplugged_after = lines;
    bench.absent_for = 0;
    const auto generator = std::make_unique<ScpiGenerator>(
        trigger_of(Dialect::kSiglentSdg),
        [&](const StudioInstrument&) {
          if (bench.opened > 0) bench.unplugged_after = -1;  // plugged in again
          return bench.open();
        },
        open_output_line, bench.host.clock());
    generator->arm(train_of(10));
    EXPECT_EQ(bench.opened, 2) << lines;
    generator->start();
    EXPECT_EQ(bench.generator.pulses, 10);
  }
}

TEST(ScpiGenerator, reports_an_instrument_that_stays_absent_and_one_that_is_too_slow) {
  Bench bench("siglent-sdg");
  bench.absent_for = 1000;
  const auto generator = generator_on(bench, trigger_of(Dialect::kSiglentSdg));
  EXPECT_EQ(refusal(*generator), "usb:0957:2c07: no such instrument on USB");
  EXPECT_EQ(bench.opened, 3);
  Bench slow("siglent-sdg");
  slow.answer_takes = milliseconds(900);
  const auto other = generator_on(slow, trigger_of(Dialect::kSiglentSdg));
  const MonotonicInstant before = slow.host.now;
  EXPECT_THAT(refusal(*other), HasSubstr("is too slow"));
  EXPECT_LT(slow.host.now - before, seconds(15));
}

TEST(ScpiGenerator, waits_some_seconds_for_an_instrument_that_was_unplugged_during_arm) {
  Bench bench("siglent-sdg");
  bench.unplugged_after = 5;
  const auto back = [&](MonotonicInstant at) {
    return std::make_unique<ScpiGenerator>(
        trigger_of(Dialect::kSiglentSdg),
        [&bench, at](const StudioInstrument&) {
          if (bench.opened > 0) bench.unplugged_after = -1;
          if (bench.opened > 0 && bench.host.now < at) {
            throw InstrumentAbsent("no such instrument on USB");
          }
          return bench.open();
        },
        open_output_line, bench.host.clock());
  };
  const auto generator = back(bench.host.now + seconds(5));
  generator->arm(train_of(10));
  generator->start();
  EXPECT_EQ(bench.generator.pulses, 10);
  bench.unplugged_after = 5;
  bench.opened = 0;
  const auto other = back(bench.host.now + seconds(3600));
  EXPECT_EQ(refusal(*other), "usb:0957:2c07: was unplugged and was not plugged in again");
}

TEST(ScpiGenerator, waits_some_seconds_for_an_instrument_that_another_program_uses) {
  Bench bench("siglent-sdg");
  const auto busy_until = [&](MonotonicInstant at) {
    return std::make_unique<ScpiGenerator>(
        trigger_of(Dialect::kSiglentSdg),
        [&bench, at](const StudioInstrument&) {
          if (bench.host.now < at) throw InstrumentBusy("/dev/ttyUSB0: Device or resource busy");
          return bench.open();
        },
        open_output_line, bench.host.clock());
  };
  const auto generator = busy_until(bench.host.now + seconds(5));
  generator->arm(train_of(10));
  generator->start();
  EXPECT_EQ(bench.generator.pulses, 10);
  const auto other = busy_until(bench.host.now + seconds(3600));
  EXPECT_EQ(refusal(*other), "usb:0957:2c07: /dev/ttyUSB0: Device or resource busy");
}

TEST(ScpiGenerator, turns_its_output_off_when_it_was_armed_but_not_started) {
  Bench bench("keysight33500");
  const auto generator = generator_on(bench, trigger_of(Dialect::kKeysight33500));
  generator->arm(train_of(10));
  EXPECT_TRUE(bench.generator.output_on());
  generator->stop();
  EXPECT_FALSE(bench.generator.output_on());
  EXPECT_EQ(generator->commanded(), 0);
  EXPECT_TRUE(generator->finished());
}

/// A generator that was unplugged during a train, and could not be stopped.
std::unique_ptr<ScpiGenerator> unplugged_generator(Bench& bench) {
  auto generator = generator_on(bench, trigger_of(Dialect::kSiglentSdg));
  generator->arm(train_of({}));
  generator->start();
  bench.unplugged_after = 0;
  generator->stop();
  return generator;
}

TEST(ScpiGenerator, reports_that_pulses_may_continue_when_it_cannot_stop_them) {
  Bench bench("siglent-sdg");
  const auto generator = unplugged_generator(bench);
  EXPECT_THAT(generator->fault(),
              HasSubstr("pulses may continue: usb:0957:2c07: was unplugged and"));
}

TEST(ScpiGenerator, stops_the_pulses_when_it_is_plugged_in_again) {
  Bench bench("siglent-sdg");
  const auto generator = unplugged_generator(bench);
  EXPECT_TRUE(bench.generator.output_on());
  const int64_t commanded = generator->commanded();
  bench.unplugged_after = -1;
  generator->stop();
  EXPECT_FALSE(bench.generator.output_on());
  EXPECT_EQ(generator->fault(), "");
  EXPECT_EQ(generator->commanded(), commanded) << "the take has ended";
}

TEST(ScpiGenerator, reports_that_pulses_may_continue_after_it_could_not_be_armed_again) {
  Bench bench("siglent-sdg");
  const auto generator = unplugged_generator(bench);
  EXPECT_THROW(generator->arm(train_of(10)), InputError);
  EXPECT_THAT(generator->fault(), HasSubstr("pulses may continue"));
  generator->stop();
  EXPECT_THAT(generator->fault(), HasSubstr("pulses may continue"));
  bench.unplugged_after = -1;
  generator->stop();
  EXPECT_FALSE(bench.generator.output_on());
  EXPECT_EQ(generator->fault(), "");
}

TEST(ScpiGenerator, reports_no_pulses_after_it_was_turned_off_and_could_not_be_armed) {
  Bench bench("siglent-sdg");
  const auto generator = unplugged_generator(bench);
  bench.unplugged_after = -1;
  bench.invalid_answers["C1:BSWV?"] = "C1:BSWV WVTP,SINE";
  EXPECT_THROW(generator->arm(train_of(10)), InputError);
  EXPECT_FALSE(bench.generator.output_on());
  generator->stop();
  EXPECT_EQ(generator->fault(), "");
}

TEST(ScpiGeneratorDeathTest, aborts_with_a_message_when_it_is_started_before_arm) {
  Bench bench("keysight33500");
  const auto generator = generator_on(bench, trigger_of(Dialect::kKeysight33500));
  EXPECT_DEATH(generator->start(), "check failed: .*arm\\(\\) comes first");
}

TEST(ScpiAnswers, match_the_expected_value_in_every_equivalent_notation) {
  EXPECT_TRUE(answer_matches("+2.500000000000000E+01", "", "25"));
  EXPECT_TRUE(answer_matches("25HZ", "", "25"));
  EXPECT_TRUE(answer_matches(" 0.025 kHz\r", "", "25"));
  EXPECT_TRUE(answer_matches("1ms", "", "0.001"));
  EXPECT_TRUE(answer_matches("\"PULSE\"", "", "PULS"));
  EXPECT_TRUE(answer_matches("PULS", "", "PULSE"));
  EXPECT_TRUE(answer_matches("9.9E37", "", "INF"));
  EXPECT_TRUE(answer_matches("INFINITY", "", "INF"));
  EXPECT_TRUE(answer_matches("1", "", "ON"));
  EXPECT_TRUE(answer_matches("c1:bswv wvtp,pulse,frq,25HZ", "FRQ", "25"));
  EXPECT_TRUE(answer_matches("C1:OUTP OFF,LOAD,HZ,PLRT,NOR", "*", "OFF"));
  EXPECT_TRUE(answer_matches("+1.000050000E+06", "", "1000050", true));
}

TEST(ScpiAnswers, do_not_match_another_value) {
  EXPECT_FALSE(answer_matches("25.01", "", "25"));
  EXPECT_FALSE(answer_matches("25 V.I.P.", "", "25"));
  EXPECT_FALSE(answer_matches("-25", "", "25"));
  EXPECT_FALSE(answer_matches("INF", "", "25"));
  EXPECT_FALSE(answer_matches("1e30", "", "INF"));
  EXPECT_FALSE(answer_matches("", "", "0"));
  EXPECT_FALSE(answer_matches("", "", "PULS"));
  EXPECT_FALSE(answer_matches("P", "", "PULS"));
  EXPECT_FALSE(answer_matches("SQU", "", "PULS"));
  EXPECT_FALSE(answer_matches("0", "", "ON"));
  EXPECT_FALSE(answer_matches("C1:BSWV WVTP,FRQ", "FRQ", "25"));
  EXPECT_FALSE(answer_matches("C1:BSWV", "*", "OFF"));
  EXPECT_FALSE(answer_matches("1000000", "", "1000050", true));
  EXPECT_FALSE(answer_matches("1.0000E+05", "", "100004", true));
}

}  // namespace
}  // namespace v3d::trigger
