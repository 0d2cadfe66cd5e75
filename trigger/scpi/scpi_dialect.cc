#include "trigger/scpi/scpi_dialect.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <utility>

namespace v3d::trigger {
namespace {

/// SCPI's number for infinity is 9.9E37.
constexpr double kScpiInfinity = 9e36;

// Each table names its sources, and the commands that are not from a manual. Settings that conflict
// temporarily (an old width that is longer than the new period) leave an error in the queue. It is
// cleared before the burst is set up, since each setting is read back anyway.

/// Keysight (Agilent) 33500 and 33600: Operating and Service Guide 33500-90901, "BURSt Subsystem"
/// (configure, count, trigger source, enable, in this order; N cycles or INFinity, answered
/// 9.9E+37; TRIGger[1|2]:SOURce BUS and *TRG; GATE:POLarity of the Trig In connector), "OUTPut",
/// "FUNCtion" (PULSe:WIDTh) and "VOLTage" subsystems. The burst is armed before the output is
/// connected.
const ScpiDialect kKeysight = {
    .name = "keysight33500",
    .makers = {"KEYSIGHT", "AGILENT"},
    .error_query = "SYST:ERR?",
    .off = {{"OUTP{channel} OFF", "OUTP{channel}?", "", "OFF"}},
    .shape = {{"SOUR{channel}:BURS:STAT OFF", "SOUR{channel}:BURS:STAT?", "", "OFF"},
              {"OUTP{channel}:LOAD INF", "OUTP{channel}:LOAD?", "", "INF"},
              {"OUTP{channel}:POL NORM", "OUTP{channel}:POL?", "", "NORM"},
              {"SOUR{channel}:FUNC PULS", "SOUR{channel}:FUNC?", "", "PULS"},
              {"SOUR{channel}:FREQ {rate}", "SOUR{channel}:FREQ?", "", "{rate}"},
              {"SOUR{channel}:FUNC:PULS:WIDT {width}", "SOUR{channel}:FUNC:PULS:WIDT?", "",
               "{width}"},
              {"SOUR{channel}:VOLT:HIGH {high}", "SOUR{channel}:VOLT:HIGH?", "", "{high}"},
              {"SOUR{channel}:VOLT:LOW 0", "SOUR{channel}:VOLT:LOW?", "", "0"},
              {"*CLS"}},
    .burst = {{"SOUR{channel}:BURS:MODE TRIG", "SOUR{channel}:BURS:MODE?", "", "TRIG"},
              {"TRIG{channel}:SOUR BUS", "TRIG{channel}:SOUR?", "", "BUS"},
              {"SOUR{channel}:BURS:NCYC {count}", "SOUR{channel}:BURS:NCYC?", "", "{count}"},
              {"SOUR{channel}:BURS:STAT ON", "SOUR{channel}:BURS:STAT?", "", "ON"}},
    .endless = {{"SOUR{channel}:BURS:MODE TRIG", "SOUR{channel}:BURS:MODE?", "", "TRIG"},
                {"TRIG{channel}:SOUR BUS", "TRIG{channel}:SOUR?", "", "BUS"},
                {"SOUR{channel}:BURS:NCYC INF", "SOUR{channel}:BURS:NCYC?", "", "INF"},
                {"SOUR{channel}:BURS:STAT ON", "SOUR{channel}:BURS:STAT?", "", "ON"}},
    .gated = {{"SOUR{channel}:BURS:MODE GAT", "SOUR{channel}:BURS:MODE?", "", "GAT"},
              {"SOUR{channel}:BURS:GATE:POL NORM", "SOUR{channel}:BURS:GATE:POL?", "", "NORM"},
              {"SOUR{channel}:BURS:STAT ON", "SOUR{channel}:BURS:STAT?", "", "ON"}},
    .on = {{"OUTP{channel} ON", "OUTP{channel}?", "", "ON"}},
    .start = "*TRG"};

/// Rigol: DG800, DG900 and DG2000 Programming Guides, chapter 2: ":SOURce:BURSt" (MODE TRIG, INF or
/// GAT; TRIGger:SOURce MANual, TRIGger[:IMMediate]; GATE:POLarity of the rear connector; IDLE,
/// without which the level between bursts is the first point of the waveform), ":OUTPut" (LOAD
/// INFinity, answered 9.9E+37). The DG1000Z has the same commands, according to published drivers;
/// its guide was not available.
const ScpiDialect kRigol = {
    .name = "rigol-dg",
    .makers = {"RIGOL"},
    .error_query = ":SYST:ERR?",
    .off = {{":OUTP{channel} OFF", ":OUTP{channel}?", "", "OFF"}},
    .shape = {{":SOUR{channel}:BURS:STAT OFF", ":SOUR{channel}:BURS:STAT?", "", "OFF"},
              {":OUTP{channel}:LOAD INF", ":OUTP{channel}:LOAD?", "", "INF"},
              {":OUTP{channel}:POL NORM", ":OUTP{channel}:POL?", "", "NORM"},
              {":SOUR{channel}:FUNC PULS", ":SOUR{channel}:FUNC?", "", "PULS"},
              {":SOUR{channel}:FREQ {rate}", ":SOUR{channel}:FREQ?", "", "{rate}"},
              {":SOUR{channel}:FUNC:PULS:WIDT {width}", ":SOUR{channel}:FUNC:PULS:WIDT?", "",
               "{width}"},
              {":SOUR{channel}:VOLT:HIGH {high}", ":SOUR{channel}:VOLT:HIGH?", "", "{high}"},
              {":SOUR{channel}:VOLT:LOW 0", ":SOUR{channel}:VOLT:LOW?", "", "0"},
              {":SOUR{channel}:BURS:IDLE BOTTOM", ":SOUR{channel}:BURS:IDLE?", "", "BOTTOM"},
              {"*CLS"}},
    .burst = {{":SOUR{channel}:BURS:MODE TRIG", ":SOUR{channel}:BURS:MODE?", "", "TRIG"},
              {":SOUR{channel}:BURS:TRIG:SOUR MAN", ":SOUR{channel}:BURS:TRIG:SOUR?", "", "MAN"},
              {":SOUR{channel}:BURS:NCYC {count}", ":SOUR{channel}:BURS:NCYC?", "", "{count}"},
              {":SOUR{channel}:BURS:STAT ON", ":SOUR{channel}:BURS:STAT?", "", "ON"}},
    .endless = {{":SOUR{channel}:BURS:MODE INF", ":SOUR{channel}:BURS:MODE?", "", "INF"},
                {":SOUR{channel}:BURS:TRIG:SOUR MAN", ":SOUR{channel}:BURS:TRIG:SOUR?", "", "MAN"},
                {":SOUR{channel}:BURS:STAT ON", ":SOUR{channel}:BURS:STAT?", "", "ON"}},
    .gated = {{":SOUR{channel}:BURS:MODE GAT", ":SOUR{channel}:BURS:MODE?", "", "GAT"},
              {":SOUR{channel}:BURS:GATE:POL NORM", ":SOUR{channel}:BURS:GATE:POL?", "", "NORM"},
              {":SOUR{channel}:BURS:STAT ON", ":SOUR{channel}:BURS:STAT?", "", "ON"}},
    .on = {{":OUTP{channel} ON", ":OUTP{channel}?", "", "ON"}},
    .start = ":SOUR{channel}:BURS:TRIG"};

/// Siglent SDG1000X, 2000X, 6000X: Programming Guide PG02, "BTWV" (STATE comes first: the
/// instrument rejects the others while it is off; GATE_NCYC, TRSR, TIME in cycles or INF, MTRIG),
/// "BSWV", "OUTP" (LOAD HZ, PLRT NOR). It makes pulses when the burst is enabled, so the output is
/// off until all is set.
const ScpiDialect kSiglent = {
    .name = "siglent-sdg",
    .makers = {"SIGLENT"},
    .off = {{"C{channel}:OUTP OFF", "C{channel}:OUTP?", "*", "OFF"}},
    .shape = {{"C{channel}:BTWV STATE,OFF", "C{channel}:BTWV?", "STATE", "OFF"},
              {"C{channel}:OUTP LOAD,HZ", "C{channel}:OUTP?", "LOAD", "HZ"},
              {"C{channel}:OUTP PLRT,NOR", "C{channel}:OUTP?", "PLRT", "NOR"},
              {"C{channel}:BSWV WVTP,PULSE", "C{channel}:BSWV?", "WVTP", "PULSE"},
              {"C{channel}:BSWV FRQ,{rate}", "C{channel}:BSWV?", "FRQ", "{rate}"},
              {"C{channel}:BSWV WIDTH,{width}", "C{channel}:BSWV?", "WIDTH", "{width}"},
              {"C{channel}:BSWV HLEV,{high}", "C{channel}:BSWV?", "HLEV", "{high}"},
              {"C{channel}:BSWV LLEV,0", "C{channel}:BSWV?", "LLEV", "0"}},
    .burst = {{"C{channel}:BTWV STATE,ON", "C{channel}:BTWV?", "STATE", "ON"},
              {"C{channel}:BTWV GATE_NCYC,NCYC", "C{channel}:BTWV?", "GATE_NCYC", "NCYC"},
              {"C{channel}:BTWV TRSR,MAN", "C{channel}:BTWV?", "TRSR", "MAN"},
              {"C{channel}:BTWV TIME,{count}", "C{channel}:BTWV?", "TIME", "{count}"}},
    .endless = {{"C{channel}:BTWV STATE,ON", "C{channel}:BTWV?", "STATE", "ON"},
                {"C{channel}:BTWV GATE_NCYC,NCYC", "C{channel}:BTWV?", "GATE_NCYC", "NCYC"},
                {"C{channel}:BTWV TRSR,MAN", "C{channel}:BTWV?", "TRSR", "MAN"},
                {"C{channel}:BTWV TIME,INF", "C{channel}:BTWV?", "TIME", "INF"}},
    .gated = {{"C{channel}:BTWV STATE,ON", "C{channel}:BTWV?", "STATE", "ON"},
              {"C{channel}:BTWV GATE_NCYC,GATE", "C{channel}:BTWV?", "GATE_NCYC", "GATE"},
              {"C{channel}:BTWV TRSR,EXT", "C{channel}:BTWV?", "TRSR", "EXT"}},
    .on = {{"C{channel}:OUTP ON", "C{channel}:OUTP?", "*", "ON"}},
    .start = "C{channel}:BTWV MTRIG"};

/// BNC 575 and Quantum Composers 9510 to 9530 (one design): 9500 Plus and 9530 User Manuals, "SCPI
/// Command Format" (short or long keywords; every command is answered with "ok" or "?n"; boolean
/// answers are 1 or 0; channel 0 is the clock T0 of all channels). The names of the clock settings
/// (MODE NORM, BURS; BCOunter; TRIGger and GATE MODE DIS) are those of published drivers for both
/// makes. Pulses start when channel 0 is enabled; channel {channel} is enabled before.
const ScpiDialect kBnc = {
    .name = "bnc575",
    .makers = {"BNC", "BERKELEY", "QC", "QUANTUM"},
    .acknowledges = true,
    .off = {{":PULSE0:STATE OFF", ":PULSE0:STATE?", "", "OFF"},
            {":PULSE{channel}:STATE OFF", ":PULSE{channel}:STATE?", "", "OFF"}},
    .shape = {{":PULSE0:TRIG:MODE DIS", ":PULSE0:TRIG:MODE?", "", "DIS"},
              {":PULSE0:GATE:MODE DIS", ":PULSE0:GATE:MODE?", "", "DIS"},
              {":PULSE0:PER {period}", ":PULSE0:PER?", "", "{period}"},
              {":PULSE{channel}:CMOD NORM", ":PULSE{channel}:CMOD?", "", "NORM"},
              {":PULSE{channel}:DELAY 0", ":PULSE{channel}:DELAY?", "", "0"},
              {":PULSE{channel}:WIDT {width}", ":PULSE{channel}:WIDT?", "", "{width}"},
              {":PULSE{channel}:POL NORM", ":PULSE{channel}:POL?", "", "NORM"},
              {":PULSE{channel}:OUTP:MODE ADJ", ":PULSE{channel}:OUTP:MODE?", "", "ADJ"},
              {":PULSE{channel}:OUTP:AMPL {high}", ":PULSE{channel}:OUTP:AMPL?", "", "{high}"}},
    .burst = {{":PULSE0:MODE BURS", ":PULSE0:MODE?", "", "BURS"},
              {":PULSE0:BCO {count}", ":PULSE0:BCO?", "", "{count}"}},
    .endless = {{":PULSE0:MODE NORM", ":PULSE0:MODE?", "", "NORM"}},
    .gated = {{":PULSE0:MODE NORM", ":PULSE0:MODE?", "", "NORM"},
              {":PULSE0:GATE:MODE PULS", ":PULSE0:GATE:MODE?", "", "PULS"},
              {":PULSE0:GATE:LOGIC HIGH", ":PULSE0:GATE:LOGIC?", "", "HIGH"},
              {":PULSE0:STATE ON", ":PULSE0:STATE?", "", "ON"}},
    .on = {{":PULSE{channel}:STATE ON", ":PULSE{channel}:STATE?", "", "ON"}},
    .start = ":PULSE0:STATE ON"};

std::string number_text(double value) { return fmt::format("{:.10g}", value); }

std::string upper(std::string_view text) {
  std::string result;
  for (const char c : text)
    result += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return result;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n\"";
  const size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// The value of an upper-case text with or without a unit; empty when it is not a number.
std::optional<double> number_of(std::string_view text) {
  static constexpr std::array<std::pair<std::string_view, double>, 10> kUnits = {{{"", 1},
                                                                                  {"HZ", 1},
                                                                                  {"KHZ", 1e3},
                                                                                  {"MHZ", 1e6},
                                                                                  {"S", 1},
                                                                                  {"MS", 1e-3},
                                                                                  {"US", 1e-6},
                                                                                  {"NS", 1e-9},
                                                                                  {"V", 1},
                                                                                  {"MV", 1e-3}}};
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || std::isnan(value)) return {};
  const std::string_view unit = trimmed(text.substr(static_cast<size_t>(end - text.data())));
  for (const auto& [name, factor] : kUnits) {
    if (unit == name) return value * factor;
  }
  return {};
}

bool same_number(double a, double b, bool is_count) {
  if (std::abs(a) > kScpiInfinity || std::abs(b) > kScpiInfinity) {
    return a > kScpiInfinity && b > kScpiInfinity;
  }
  return std::abs(a - b) <= (is_count ? 0 : 1e-4 * std::abs(a)) + 1e-9;
}

bool same_word(std::string_view a, std::string_view b) {
  constexpr size_t kMinAbbreviation = 3;
  if (a.size() > b.size()) std::swap(a, b);
  return a == b || (a.size() >= kMinAbbreviation && b.starts_with(a));
}

std::string_view field_of(std::string_view answer, std::string_view field) {
  if (field.empty()) return answer;
  std::string_view remaining = trimmed(answer.substr(std::min(answer.size(), answer.find(' '))));
  if (field == "*") return trimmed(remaining.substr(0, remaining.find(',')));
  while (!remaining.empty()) {
    const size_t comma = remaining.find(',');
    const bool found = trimmed(remaining.substr(0, comma)) == field;
    if (comma == std::string_view::npos) break;
    remaining.remove_prefix(comma + 1);
    if (found) return trimmed(remaining.substr(0, remaining.find(',')));
  }
  return {};
}

}  // namespace

const ScpiDialect& scpi_dialect(Dialect dialect) {
  switch (dialect) {
    case Dialect::kKeysight33500:
      return kKeysight;
    case Dialect::kRigolDg:
      return kRigol;
    case Dialect::kSiglentSdg:
      return kSiglent;
    case Dialect::kBnc575:
      break;
  }
  return kBnc;
}

std::string substitute_values(std::string_view text, const ScpiValues& values) {
  const std::array<std::pair<std::string_view, std::string>, 6> names = {
      {{"{channel}", std::to_string(values.channel)},
       {"{rate}", number_text(values.train.rate_hz)},
       {"{period}", number_text(1 / values.train.rate_hz)},
       {"{width}", number_text(to_seconds(values.train.width))},
       {"{high}", number_text(values.high_v)},
       {"{count}", std::to_string(values.train.count.value_or(1))}}};
  std::string result(text);
  for (const auto& [name, value] : names) {
    for (size_t at = result.find(name); at != std::string::npos; at = result.find(name, at)) {
      result.replace(at, name.size(), value);
    }
  }
  return result;
}

bool answer_matches(std::string_view answer, std::string_view field, std::string_view expected,
                    bool is_count) {
  const std::string all = upper(trimmed(answer));
  const std::string_view got = field_of(all, field);
  const auto got_number = number_of(got);
  if (const auto number = number_of(expected)) {
    return got_number && same_number(*number, *got_number, is_count);
  }
  if (expected == "ON" && got_number) return *got_number == 1;
  if (expected == "OFF" && got_number) return *got_number == 0;
  return !got.empty() && same_word(got, expected);
}

}  // namespace v3d::trigger
