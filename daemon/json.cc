#include "daemon/json.h"

#include <nlohmann/json.hpp>

namespace v3d {

std::string ledger_json(const Ledger& ledger) {
  nlohmann::json cameras = nlohmann::json::array();
  for (const CameraLedger& c : ledger.cameras) {
    cameras.push_back({{"name", c.name},
                       {"exposed", c.exposed},
                       {"received", c.received},
                       {"written", c.written},
                       {"published", c.published},
                       {"missing", c.missing},
                       {"duplicate", c.duplicate},
                       {"suspect", c.suspect}});
  }
  const nlohmann::json json = {
      {"take", ledger.take},
      {"complete", ledger.complete()},
      {"pulses",
       {{"commanded", ledger.commanded},
        {"sensed", ledger.sensed ? nlohmann::json(*ledger.sensed) : nlohmann::json()},
        {"unsensed", ledger.unsensed},
        {"extra", ledger.extra},
        {"runt", ledger.runt}}},
      {"cameras", cameras}};
  return json.dump();
}

std::string numbers_json(const std::map<std::string, double>& values) {
  return nlohmann::json(values).dump();
}

}  // namespace v3d
