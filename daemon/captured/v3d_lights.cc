// v3d-lights: sends values to the lamps on a DMX interface. v3d-captured starts it when the studio
// file has [lights]. It is a program of its own, so that OLA's libraries cannot end a recording.
#include <ola/Callback.h>
#include <ola/DmxBuffer.h>
#include <ola/Logging.h>
#include <ola/client/ClientWrapper.h>
#include <ola/client/OlaClient.h>
#include <ola/client/Result.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "cli/command.h"

namespace {

constexpr int kIntervalMs = 1000;  ///< of repetitions
constexpr int kMaxUniverse = 65'535;
constexpr auto kAnswerTimeout = std::chrono::seconds(3);
constexpr int kMaxWaitUs = 100'000;

/// Values of the channels 1, 2, ..., separated by spaces. Throws InputError.
ola::DmxBuffer values_of(const std::string& line) {
  std::istringstream words(line);
  std::string values;
  for (int value = 0; words >> value;) {
    if (value < 0 || value > 255) break;
    values += static_cast<char>(value);
  }
  if (!words.eof() || values.empty() || values.size() > ola::DMX_UNIVERSE_SIZE) {
    throw v3d::InputError("'" + line + "': expected 1 to 512 numbers from 0 to 255");
  }
  return {reinterpret_cast<const uint8_t*>(values.data()), static_cast<unsigned>(values.size())};
}

/// The lines of standard input.
class Input {
 public:
  /// Adds what was written; false at the end of the input.
  bool read_more() {
    std::array<char, 4096> part{};
    const ssize_t got = read(STDIN_FILENO, part.data(), part.size());
    if (got > 0) text_.append(part.data(), static_cast<size_t>(got));
    return got > 0;
  }
  /// The last whole line since the last call; empty: none.
  std::string last_line() {
    const size_t end = text_.rfind('\n');
    if (end == std::string::npos) return "";
    const size_t before = end > 0 ? text_.rfind('\n', end - 1) : std::string::npos;
    const size_t begin = before == std::string::npos ? 0 : before + 1;
    std::string line = text_.substr(begin, end - begin);
    text_.erase(0, end + 1);
    return line;
  }

 private:
  std::string text_;
};

constexpr char kNoAnswer[] = "olad does not answer on port 9010 of this PC";

/// A connection to olad.
class Olad {
 public:
  /// Waits for an answer, because the kernel connects also to an olad that hangs. Throws
  /// std::runtime_error without one.
  Olad() : wrapper_(false) {
    if (!wrapper_.Setup()) throw std::runtime_error(kNoAnswer);
    wrapper_.SetCloseCallback(ola::NewCallback(this, &Olad::close));
    wrapper_.GetClient()->FetchPluginList(ola::NewSingleCallback(this, &Olad::take_plugins));
    wait_for_answer();
  }

  /// Waits until olad has taken the values: it drops what it has not read when a connection ends.
  /// Throws std::runtime_error with olad's answer.
  void send(unsigned universe, const ola::DmxBuffer& values) {
    has_answered_ = false;
    wrapper_.GetClient()->SendDMX(
        universe, values, ola::client::SendDMXArgs(ola::NewSingleCallback(this, &Olad::take)));
    wait_for_answer();
    if (!error_.empty()) {
      throw std::runtime_error("olad: " + error_ + " (universe " + std::to_string(universe) + ")");
    }
  }

 private:
  void wait_for_answer() {
    const auto until = std::chrono::steady_clock::now() + kAnswerTimeout;
    while (!has_answered_ && is_open_ && std::chrono::steady_clock::now() < until) {
      wrapper_.GetSelectServer()->RunOnce(ola::TimeInterval(0, kMaxWaitUs));
    }
    if (!is_open_) throw std::runtime_error("olad has closed the connection");
    if (!has_answered_) throw std::runtime_error(kNoAnswer);
  }
  void take(const ola::client::Result& result) {
    has_answered_ = true;
    error_ = result.Error();
  }
  void take_plugins(const ola::client::Result&, const std::vector<ola::client::OlaPlugin>&) {
    has_answered_ = true;
  }
  void close() {
    is_open_ = false;
    wrapper_.GetSelectServer()->Terminate();
  }

  ola::client::OlaClientWrapper wrapper_;
  bool has_answered_ = false, is_open_ = true;
  std::string error_;
};

void run(unsigned universe) {
  ola::InitLogging(ola::OLA_LOG_NONE, ola::OLA_LOG_NULL);
  Olad olad;
  std::cout << "connected" << std::endl;  // v3d-captured reads this line
  ola::DmxBuffer values;
  Input input;
  while (true) {
    pollfd ready{STDIN_FILENO, POLLIN, 0};
    if (poll(&ready, 1, kIntervalMs) > 0 && !input.read_more()) return;
    if (const std::string line = input.last_line(); !line.empty()) values = values_of(line);
    // To olad, a source that is silent for some seconds is lost.
    if (values.Size() > 0) olad.send(universe, values);
  }
}

}  // namespace

int main(int argc, char** argv) {
  v3d::cli::Program app(
      "Send values to lamps on DMX, by OLA's daemon olad on this PC. v3d-captured starts this "
      "program "
      "for [lights] in the studio file. Each line of standard input has the values of the channels "
      "1, 2, ...; the last line is repeated every second.",
      "v3d-lights");
  app.add_version(V3D_VERSION);
  int universe = 1;
  app.add_option("--universe", universe, "Universe of olad")
      .check(v3d::cli::integer_in(0, kMaxUniverse))
      .show_default();
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  try {
    run(static_cast<unsigned>(universe));
  } catch (const v3d::InputError& error) {
    std::cerr << error.what() << '\n';
    return v3d::kExitBadInput;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return v3d::kExitFailed;
  }
  return v3d::kExitDone;
}
