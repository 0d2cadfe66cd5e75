#include "daemon/control/reply_json.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/control/packed_numbers.h"

namespace v3d::control {
namespace {

/// Adds `absent_nodes` [{name, cameras}] if there are any.
template <class Json>
void add_absent_nodes(const std::vector<take::TakeNode>& nodes, Json& json) {
  for (const take::TakeNode& node : nodes) {
    json["absent_nodes"].push_back({{"name", node.name}, {"cameras", node.cameras}});
  }
}

/// Adds `sounds`, the sound files and what problem_line() reports of them, if there are any.
void add_sounds(const std::vector<take::SoundLedger>& sounds, nlohmann::json& json) {
  for (const take::SoundLedger& sound : sounds) {
    json["sounds"].push_back({{"file", sound.file},
                              {"node", sound.node},
                              {"samples", sound.samples},
                              {"map_source", sound.map_source},
                              {"xruns", sound.xruns},
                              {"lost_samples", sound.lost_samples},
                              {"missing_edges", sound.missing_edges},
                              {"timecode_jumps", sound.timecode_jumps}});
  }
}

nlohmann::ordered_json take_json(const take::TakeListing& take) {
  std::error_code error;
  const auto mesh_bytes = std::filesystem::file_size(take.paths.mesh(), error);
  nlohmann::ordered_json json = {
      {"name", take.info.name},
      {"studio", take.info.studio},
      {"started_ns", to_ns(take.info.started)},
      {"state", take.verdict()},
      {"verified", take.verified},
      {"rate_hz", take.info.rate_hz},
      {"pulses", take.info.pulses},
      {"seconds", take.seconds()},
      {"bytes", take.bytes},
      {"mesh_bytes", error ? 0 : mesh_bytes},
      {"proxy_bytes", take.proxy_bytes},
      {"cameras", take.info.cameras},
      {"meshes", take.meshes ? nlohmann::ordered_json(*take.meshes) : nullptr},
      {"slate",
       {{"scene", take.slate.scene},
        {"take", take.slate.take},
        {"note", take.slate.note},
        {"mark", name(take.slate.mark)}}}};
  if (!take.meshes) json["mesh_error"] = take.mesh_error;
  if (!take.error.empty()) json["error"] = take.error;
  if (!take.timecode.empty()) json["timecode"] = take.timecode;
  add_absent_nodes(take.absent_nodes, json);
  return json;
}

size_t count_of_numbers(const take::Ledger& ledger) {
  size_t count = ledger.unsensed.size() + ledger.runt.size();
  for (const take::CameraLedger& c : ledger.cameras) {
    count += c.missing.size() + c.duplicate.size() + c.suspect.size();
  }
  return count;
}

nlohmann::json list_json(const std::vector<int64_t>& numbers, bool is_packed) {
  return is_packed ? nlohmann::json(pack_numbers(numbers)) : nlohmann::json(numbers);
}

/// `is_packed`: its lists of pulses are packed.
nlohmann::json json_of(const take::Ledger& ledger, bool is_packed) {
  const auto list = [&](const std::vector<int64_t>& numbers) {
    return list_json(numbers, is_packed);
  };
  nlohmann::json cameras = nlohmann::json::array();
  for (const take::CameraLedger& c : ledger.cameras) {
    cameras.push_back({{"name", c.name},
                       {"exposed", c.exposed},
                       {"received", c.received},
                       {"written", c.written},
                       {"published", c.published},
                       {"missing", list(c.missing)},
                       {"duplicate", list(c.duplicate)},
                       {"suspect", list(c.suspect)}});
  }
  nlohmann::json json = {
      {"take", ledger.take},
      {"complete", ledger.complete()},
      {"pulses",
       {{"commanded", ledger.commanded},
        {"sensed", ledger.sensed ? nlohmann::json(*ledger.sensed) : nlohmann::json()},
        {"unsensed", list(ledger.unsensed)},
        {"extra", ledger.extra},
        {"runt", list(ledger.runt)}}},
      {"cameras", cameras}};
  if (ledger.commanded_is_minimum) json["pulses"]["commanded_is_minimum"] = true;
  add_absent_nodes(ledger.absent_nodes, json);
  add_sounds(ledger.sounds, json);
  return json;
}

}  // namespace

std::string takes_json(const std::vector<take::TakeListing>& takes, int indent) {
  auto list = nlohmann::ordered_json::array();
  for (const take::TakeListing& take : takes) list.push_back(take_json(take));
  const nlohmann::ordered_json json = {{"takes", list}};
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string ledger_json(const take::Ledger& ledger) { return json_of(ledger, false).dump(); }

std::string ledger_detail(const take::Ledger& ledger) {
  std::string detail = json_of(ledger, count_of_numbers(ledger) > kMaxListedNumbers).dump();
  if (detail.size() <= kMaxDetailBytes) return detail;
  return nlohmann::json({{"take", ledger.take}, {"complete", false}, {"cameras", nullptr}}).dump();
}

std::string numbers_json(const std::map<std::string, double>& values) {
  return nlohmann::json(values).dump();
}

std::string recon_json(const std::map<std::string, double>& values,
                       const std::vector<int64_t>& without_mesh) {
  nlohmann::json json(values);
  json["without_mesh"] = list_json(without_mesh, without_mesh.size() > kMaxListedNumbers);
  return json.dump();
}

}  // namespace v3d::control
