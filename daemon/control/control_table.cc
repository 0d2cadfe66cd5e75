#include "daemon/control/control_table.h"

#include <array>

namespace v3d {

std::string_view name(Phase phase) {
  constexpr std::array<std::string_view, kPhaseCount> kNames = {
      "idle", "arming", "prepared", "armed", "recording", "draining", "learning", "fault"};
  return kNames.at(static_cast<size_t>(phase));
}

std::string_view name(Input input) {
  constexpr std::array<std::string_view, kInputCount> kNames = {
      "arm",   "start",  "stop",    "abort",       "background", "commit", "learn",   "check",
      "ready", "failed", "expired", "train_ended", "drained",    "broken", "rejoined"};
  return kNames.at(static_cast<size_t>(input));
}

std::string_view name(Work work) {
  constexpr std::array<std::string_view, 6> kNames = {"-",     "arm",    "start",
                                                      "drain", "disarm", "learn"};
  return kNames.at(static_cast<size_t>(work));
}

std::string_view name(Verdict verdict) {
  constexpr std::array<std::string_view, 4> kNames = {"-", "done", "pending", "refused"};
  return kNames.at(static_cast<size_t>(verdict));
}

}  // namespace v3d
