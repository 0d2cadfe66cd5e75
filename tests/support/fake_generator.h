// Simulated signal generator: stores the settings of SCPI commands, answers queries, and counts the
// pulses that it makes. Used by the unit tests and by the USB gadget of the lab.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace v3d::test {

/// Not thread-safe.
class FakeGenerator {
 public:
  /// "keysight33500", "rigol-dg", "siglent-sdg" or "bnc575", as in the studio file.
  explicit FakeGenerator(std::string dialect) : dialect_(std::move(dialect)) {}

  /// Processes one command line without its line end. Returns the answer, if there is one. A
  /// setting whose header is `lies` is acknowledged but not stored.
  std::optional<std::string> process(const std::string& line) {
    received.push_back(line);
    if (line == "*IDN?") return identity();
    if (line == "*CLS") return {};
    if (line.find("SYST:ERR?") != std::string::npos) return "+0,\"No error\"";
    if (is_start(line)) {
      fire();
      return acknowledgement();
    }
    const bool keyed = dialect_ == "siglent-sdg";
    if (line.back() == '?') return keyed ? keyed_answer(line) : plain_answer(line);
    if (keyed) {
      store_keyed(line);
    } else {
      store(line);
    }
    if (!output_on()) pulses = 0;
    return acknowledgement();
  }

  bool output_on() const {
    if (dialect_ == "siglent-sdg") return get("C1:OUTP *") == "ON";
    if (dialect_ == "bnc575") return get(":PULSE0:STATE") == "ON" && get(":PULSE1:STATE") == "ON";
    return get(dialect_ == "rigol-dg" ? ":OUTP1" : "OUTP1") == "ON";
  }
  double rate_hz() const {
    if (dialect_ == "siglent-sdg") return number("C1:BSWV FRQ");
    if (dialect_ == "bnc575") return 1 / number(":PULSE0:PER");
    return number(dialect_ == "rigol-dg" ? ":SOUR1:FREQ" : "SOUR1:FREQ");
  }
  double width_s() const {
    if (dialect_ == "siglent-sdg") return number("C1:BSWV WIDTH");
    if (dialect_ == "bnc575") return number(":PULSE1:WIDT");
    return number(dialect_ == "rigol-dg" ? ":SOUR1:FUNC:PULS:WIDT" : "SOUR1:FUNC:PULS:WIDT");
  }

  std::vector<std::string> received;  ///< all received lines
  std::string lies;                   ///< header of a setting that it ignores
  int64_t max_count = 0;              ///< shortens a longer burst without an error; 0: no limit
  int64_t pulses = 0;                 ///< length of the train since the last start; -1: without end

 private:
  std::string identity() const {
    if (dialect_ == "siglent-sdg") return "Siglent Technologies,SDG2042X,0001,1.0";
    if (dialect_ == "bnc575") return "BNC,575-4,0001,2.4.1";
    if (dialect_ == "rigol-dg") return "Rigol Technologies,DG1022Z,0001,00.01";
    return "Agilent Technologies,33522B,0001,4.00";
  }
  std::optional<std::string> acknowledgement() const {
    return dialect_ == "bnc575" ? std::optional<std::string>("ok") : std::nullopt;
  }
  std::string get(const std::string& setting) const {
    const auto found = settings_.find(setting);
    return found == settings_.end() ? "OFF" : found->second;
  }
  double number(const std::string& setting) const { return std::atof(get(setting).c_str()); }

  bool is_start(const std::string& line) {
    if (line != ":PULSE0:STATE ON") {
      return line == "*TRG" || line == ":SOUR1:BURS:TRIG" || line == "C1:BTWV MTRIG";
    }
    store(line);
    return true;
  }
  void fire() {
    if (!output_on()) return;
    std::string count;
    if (dialect_ == "siglent-sdg") {
      count = get("C1:BTWV TIME");
    } else if (dialect_ == "bnc575") {
      count = get(":PULSE0:MODE") == "BURS" ? get(":PULSE0:BCO") : "INF";
    } else if (dialect_ == "rigol-dg") {
      count = get(":SOUR1:BURS:MODE") == "INF" ? "INF" : get(":SOUR1:BURS:NCYC");
    } else {
      count = get("SOUR1:BURS:NCYC");
    }
    pulses = count == "INF" ? -1 : std::atoll(count.c_str());
  }

  void store(const std::string& line) {
    const size_t space = line.find(' ');
    const std::string header = line.substr(0, space);
    if (space != std::string::npos && header != lies) {
      settings_[header] = limited(header, line.substr(space + 1));
    }
  }
  /// The value of a setting as the instrument stores it.
  std::string limited(const std::string& setting, const std::string& value) const {
    const bool is_count = setting == "SOUR1:BURS:NCYC" || setting == ":SOUR1:BURS:NCYC" ||
                          setting == ":PULSE0:BCO" || setting == "C1:BTWV TIME";
    const bool is_long = is_count && max_count > 0 && std::atoll(value.c_str()) > max_count;
    return is_long ? std::to_string(max_count) : value;
  }
  /// Answer to a query, in the number format of such instruments.
  std::string plain_answer(const std::string& line) const {
    const std::string value = get(line.substr(0, line.size() - 1));
    char* end = nullptr;
    const double parsed = std::strtod(value.c_str(), &end);
    if (value == "INF") return "9.9E+37";
    if (value == "ON" || value == "OFF") return value == "ON" ? "1" : "0";
    if (*end != 0) return value;
    char text[32];
    std::snprintf(text, sizeof text, "%+.9E", parsed);
    return text;
  }

  /// Stores settings of the forms "C1:BSWV KEY,VALUE" and "C1:OUTP ON".
  void store_keyed(const std::string& line) {
    const size_t space = line.find(' ');
    const size_t comma = line.find(',');
    const std::string header = line.substr(0, space);
    if (comma == std::string::npos) {
      settings_[header + " *"] = line.substr(space + 1);
    } else if (line.substr(0, comma) != lies) {
      const std::string setting = line.substr(0, comma);
      settings_[setting] = limited(setting, line.substr(comma + 1));
    }
  }
  std::string keyed_answer(const std::string& line) const {
    const std::string header = line.substr(0, line.size() - 1);
    std::string answer = header + " ";
    if (header == "C1:OUTP") answer += get("C1:OUTP *") + ",";
    for (const auto& [setting, value] : settings_) {
      const std::string key = setting.substr(setting.find(' ') + 1);
      if (setting.substr(0, setting.find(' ')) != header || key == "*") continue;
      answer += key + "," + value +
                (key == "FRQ"                     ? "HZ"
                 : key == "HLEV" || key == "LLEV" ? "V"
                                                  : "") +
                ",";
    }
    return answer + "END";
  }

  const std::string dialect_;
  std::map<std::string, std::string> settings_;
};

}  // namespace v3d::test
