#include "daemon/captured/check_json.h"

#include <nlohmann/json.hpp>

namespace v3d {

std::string check_json(const Ledger& ledger, const std::vector<CheckedCamera>& cameras,
                       const std::vector<std::string>& not_ready) {
  const auto if_any = [](const auto& value) {
    return value ? nlohmann::json(*value) : nlohmann::json();
  };
  nlohmann::json checked = nlohmann::json::array();
  for (const CheckedCamera& c : cameras) {
    checked.push_back({{"name", c.pulses.name},
                       {"received", c.pulses.received},
                       {"missing", c.pulses.missing},
                       {"duplicate", c.pulses.duplicate},
                       {"suspect", c.pulses.suspect},
                       {"clipped", c.quality.clipped},
                       {"dark", c.quality.dark},
                       {"mean_grey", c.quality.mean_grey},
                       {"focus", c.quality.focus},
                       {"plates_focus", if_any(c.plates_focus)},
                       {"foreground", if_any(c.foreground)}});
  }
  const nlohmann::json json = {
      {"pulses", {{"commanded", ledger.commanded}, {"sensed", if_any(ledger.sensed)}}},
      {"checked", checked},
      {"not_ready", not_ready}};
  return json.dump();
}

}  // namespace v3d
