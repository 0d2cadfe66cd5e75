// What families of signal generators want to be told, as tables.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "trigger/pulse_train.h"

namespace v3d {

/// One setting and how it is read back. The texts hold {channel}, {rate} (Hz), {period} and {width}
/// (s), {high} (V) and {count}.
struct ScpiSetting {
  std::string_view set;
  std::string_view query = {};  ///< empty: cannot be asked
  /// Which part of the answer is meant: empty: all of it; a word: what follows that word in an
  /// answer "C1:BSWV WVTP,PULSE,FRQ,25HZ"; "*": its first part.
  std::string_view part = {};
  std::string_view want = {};
};

struct ScpiDialect {
  std::string_view name;
  std::vector<std::string_view> makers;  ///< *IDN? holds one of these words
  bool acknowledges = false;             ///< every command is answered "ok"
  std::string_view error_query = {};     ///< answers "0,..." or "+0,..." when all is well
  std::vector<ScpiSetting> off;          ///< no pulse may come after these
  std::vector<ScpiSetting> shape;        ///< of the pulses
  std::vector<ScpiSetting> burst;        ///< {count} pulses at `start`
  std::vector<ScpiSetting> endless;      ///< pulses from `start` on
  std::vector<ScpiSetting> gated;        ///< pulses while the gate input is high
  std::vector<ScpiSetting> on;           ///< the output is connected, still without a pulse
  std::string_view start;
};

const ScpiDialect& scpi_dialect(Dialect dialect);

struct ScpiValues {
  int channel = 1;
  double high_v = 3.3;
  PulseTrain train;
};
std::string fill_in(std::string_view text, const ScpiValues& values);

/// Whether an answer says what is wanted: numbers to 1 in 10,000, in any notation and with a unit;
/// words in any case, short or long ("PULS", "PULSE"); ON and OFF also as 1 and 0.
bool says(std::string_view answer, std::string_view part, std::string_view want);

}  // namespace v3d
