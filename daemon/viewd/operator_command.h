// What the studio page may ask the studio to do.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/studio_file.h"
#include "base/time.h"

namespace v3d {

struct OperatorCommand {
  enum class Verb : uint8_t {
    kLook,  ///< nothing: shows that the token is right
    kArm,
    kStart,
    kStop,
    kAbort
  };
  Verb verb = Verb::kLook;
  std::string take;                  ///< to arm
  int64_t pulses = 0;                ///< to arm: ends by itself after so many; 0: does not
  std::vector<std::string> without;  ///< to arm: cameras that may be missing

  /// "arm kendo-07, 1500 pulses, without cam07"
  std::string text() const;
  /// What v3dctl is called with, behind --studio FILE: fixed words, and names that are harmless.
  std::vector<std::string> words() const;
  /// So long v3dctl tries.
  double patience_s() const;
};

/// Of JSON that anybody may have sent: {"do": "look" | "arm" | "start" | "stop" | "abort"}, and to
/// arm "take", "seconds" (left out: until stop) and "without" [cameras of the studio]. Where it is
/// no order, `wrong` says in one line what would be one. The adapter of nlohmann::json.
struct ReadOrder {
  std::optional<OperatorCommand> order;
  std::string wrong;
};
ReadOrder read_order(std::string_view json, const Studio& studio);

/// The lines that v3dctl --json would have printed without --json: "lines" of what it printed.
/// Empty when there are none.
std::vector<std::string> lines_of_v3dctl(std::string_view json);

/// What is told of the last order, of everybody. `status`: v3dctl's exit status.
struct CommandReport {
  int64_t number = 0;  ///< counts orders
  std::string by;      ///< whom it came from
  RealtimeInstant at;
  OperatorCommand order;
  bool under_way = false;
  int status = 0;
  std::vector<std::string> lines;
};
/// {"type": "order", "number", "by", "at_ms", "do", "take", "text", "under_way", "status", "lines"}
std::string order_json(const CommandReport& report);

}  // namespace v3d
