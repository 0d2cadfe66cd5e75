// Operator commands over HTTP: parsing and running.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/child_process.h"

namespace v3d::viewd {

// The commands that the studio page can send, and their reports. Confines nlohmann::json to one
// source file.

struct OperatorCommand {
  enum class Verb : uint8_t {
    kCheckToken,  ///< executes nothing; tests the token
    kArm,
    kStart,
    kStop,
    kAbort
  };
  Verb verb = Verb::kCheckToken;
  std::string take;                  ///< kArm
  int64_t pulses = 0;                ///< kArm: number of pulses; 0: until stop
  std::vector<std::string> without;  ///< kArm: cameras that may be missing
  /// When it was given, by the clock of this server; empty: unknown.
  std::optional<RealtimeInstant> given;

  /// "arm kendo-07, 1500 pulses, without cam07"
  std::string text() const;
  /// The arguments of v3dctl after --studio FILE: fixed words, and names that is_file_name()
  /// allows.
  std::vector<std::string> arguments() const;
  /// The --timeout of v3dctl, seconds.
  double timeout_s() const;
};

/// The result of parse_command(). Without a command, `error` says in one line what is expected.
struct ParsedCommand {
  std::optional<OperatorCommand> command;
  std::string error;
};
/// Parses {"do": "check_token" | "arm" | "start" | "stop" | "abort"}, "at_ms" (when it was given,
/// since 1970; absent: unknown) and, with "arm", "take", "seconds" (absent: until stop) and
/// "without" [cameras of the studio]. Safe for hostile input.
ParsedCommand parse_command(std::string_view json, const Studio& studio);

/// The field "lines" of the output of v3dctl --json; empty if there is none.
std::vector<std::string> lines_of_v3dctl(std::string_view json);

/// The last command of any browser, and its result.
struct CommandReport {
  int64_t number = 0;  ///< counts commands, from 1
  std::string by;      ///< address of the browser
  RealtimeInstant at;
  OperatorCommand command;
  bool is_running = false;
  int status = 0;  ///< exit status of v3dctl
  std::vector<std::string> lines;
};
/// {"type": "order", "number", "by", "at_ms", "do", "take", "text", "under_way", "status", "lines"}
std::string report_json(const CommandReport& report);

// Runs v3dctl for operators' commands.

/// Starts one v3dctl process per command, with the studio file of this daemon. So a browser can do
/// what an operator can type, and only v3dctl signs commands. One command at a time. One thread.
class CommandRunner {
 public:
  explicit CommandRunner(const Studio& studio);

  /// Throws InputError if there is no v3dctl in the folder of this program.
  void require_v3dctl() const;

  /// Starts a command. Requires that none is running.
  void start(const OperatorCommand& command, MonotonicInstant now);
  /// Returns the result of the command once, when it has ended. Does not wait.
  std::optional<ProgramEnd> poll(MonotonicInstant now);

 private:
  const std::filesystem::path studio_;
  const std::filesystem::path v3dctl_;
  std::optional<ChildProgram> program_;
};

}  // namespace v3d::viewd
