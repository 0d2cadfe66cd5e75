// Command tables of signal generator families (SCPI).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

/// One setting and the query that reads it back. Placeholders in the texts: {channel}, {rate} (Hz),
/// {period} and {width} (s), {high} (V) and {count}.
struct ScpiSetting {
  std::string_view set;
  std::string_view query = {};  ///< empty: the setting cannot be read back
  /// The field of the answer to compare. Empty: the whole answer. A key: the value after this key
  /// in an answer like "C1:BSWV WVTP,PULSE,FRQ,25HZ". "*": the first field.
  std::string_view field = {};
  std::string_view expected = {};  ///< value of the field

  /// The field is a number of pulses, which must be exact.
  bool is_count() const { return expected == "{count}"; }
};

/// The commands of a family of signal generators, as tables in the order of execution.
struct ScpiDialect {
  std::string_view name;
  std::vector<std::string_view> makers;  ///< the answer to *IDN? contains one of these words
  bool acknowledges = false;             ///< every command is answered with "ok"
  std::string_view error_query = {};     ///< answer without an error: "0,..." or "+0,..."
  std::vector<ScpiSetting> off;          ///< turns the output off: no pulses afterwards
  std::vector<ScpiSetting> shape;        ///< form of the pulses
  std::vector<ScpiSetting> burst;        ///< {count} pulses after `start`
  std::vector<ScpiSetting> endless;      ///< pulses without end after `start`
  std::vector<ScpiSetting> gated;        ///< pulses while the gate input is high
  std::vector<ScpiSetting> on;           ///< connects the output, without pulses yet
  std::string_view start;
};

const ScpiDialect& scpi_dialect(Dialect dialect);

/// Values of the placeholders.
struct ScpiValues {
  int channel = 1;
  double high_v = 3.3;
  PulseTrain train;
};
/// Replaces the placeholders in `text`.
std::string substitute_values(std::string_view text, const ScpiValues& values);

/// Whether `field` of an answer (see ScpiSetting) equals `expected`. Numbers: within 1 in 10,000,
/// in any notation, with or without a unit; with `is_count` the same whole number. Words: in any
/// case, short or long ("PULS", "PULSE"). ON and OFF: also 1 and 0.
bool answer_matches(std::string_view answer, std::string_view field, std::string_view expected,
                    bool is_count = false);

}  // namespace v3d::trigger
