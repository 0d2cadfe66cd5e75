#include "daemon/control/reply_json.h"

#include <sodium.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>

namespace v3d::control {
namespace {

/// Adds `absent_nodes` [{name, cameras}] if there are any.
template <class Json>
void add_absent_nodes(const std::vector<take::TakeNode>& nodes, Json& json) {
  for (const take::TakeNode& node : nodes) {
    json["absent_nodes"].push_back({{"name", node.name}, {"cameras", node.cameras}});
  }
}

/// Adds `sounds`, the sound files and what problem_line() reports of them, and
/// `nodes_without_sound`, if there are any.
void add_sounds(const take::Ledger& ledger, nlohmann::json& json) {
  for (const std::string& node : ledger.nodes_without_sound) {
    json["nodes_without_sound"].push_back(node);
  }
  for (const take::SoundLedger& sound : ledger.sounds) {
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
  add_sounds(ledger, json);
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

namespace {

constexpr std::string_view kBits = "bits ";
constexpr int kBase64 = sodium_base64_VARIANT_ORIGINAL;
constexpr int64_t kMaxNumber = std::numeric_limits<int64_t>::max();

std::string pack_runs(const std::vector<int64_t>& numbers) {
  std::string text;
  for (size_t first = 0, last = 0; first < numbers.size(); first = last + 1) {
    last = first;
    while (last + 1 < numbers.size() && numbers[last] < kMaxNumber &&
           numbers[last + 1] == numbers[last] + 1) {
      ++last;
    }
    if (!text.empty()) text += ' ';
    text += std::to_string(numbers[first]);
    if (last > first) text += ':' + std::to_string(numbers[last]);
  }
  return text;
}

/// Requires ascending numbers. Empty when the text would not be shorter than `limit`.
std::optional<std::string> pack_bits(const std::vector<int64_t>& numbers, size_t limit) {
  if (numbers.empty()) return std::nullopt;
  const auto first = static_cast<uint64_t>(numbers.front());
  const uint64_t range = static_cast<uint64_t>(numbers.back()) - first;
  if (range / 8 >= limit) return std::nullopt;
  std::vector<uint8_t> bytes(range / 8 + 1);
  for (const int64_t number : numbers) {
    const uint64_t bit = static_cast<uint64_t>(number) - first;
    bytes[bit / 8] = static_cast<uint8_t>(bytes[bit / 8] | 1U << bit % 8);
  }
  std::string digits(sodium_base64_encoded_len(bytes.size(), kBase64), '\0');
  sodium_bin2base64(digits.data(), digits.size(), bytes.data(), bytes.size(), kBase64);
  digits.pop_back();  // the terminating zero
  std::string text = std::string(kBits) + std::to_string(numbers.front()) + " " + digits;
  return text.size() < limit ? std::optional(std::move(text)) : std::nullopt;
}

/// Reads a number at the start of `text`, and removes it. Empty where there is none.
std::optional<int64_t> consume_number(std::string_view& text) {
  int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return number;
}

bool consume_char(std::string_view& text, char expected) {
  if (!text.starts_with(expected)) return false;
  text.remove_prefix(1);
  return true;
}

std::optional<std::vector<int64_t>> unpack_runs(std::string_view text, size_t limit) {
  std::vector<int64_t> numbers;
  while (!text.empty()) {
    if (!numbers.empty() && !consume_char(text, ' ')) return std::nullopt;
    const auto first = consume_number(text);
    const auto last = consume_char(text, ':') ? consume_number(text) : first;
    if (!first || !last || *last < *first) return std::nullopt;
    const uint64_t further = static_cast<uint64_t>(*last) - static_cast<uint64_t>(*first);
    if (further >= limit - numbers.size()) return std::nullopt;
    for (uint64_t n = 0; n <= further; ++n) numbers.push_back(*first + static_cast<int64_t>(n));
  }
  return numbers;
}

std::optional<std::vector<int64_t>> unpack_bits(std::string_view text, size_t limit) {
  const auto first = consume_number(text);
  if (!first || !consume_char(text, ' ')) return std::nullopt;
  std::vector<uint8_t> bytes(text.size() / 4 * 3 + 3);
  size_t size = 0;
  const int failed = sodium_base642bin(bytes.data(), bytes.size(), text.data(), text.size(),
                                       nullptr, &size, nullptr, kBase64);
  if (failed != 0) return std::nullopt;
  const uint64_t last_bit = static_cast<uint64_t>(kMaxNumber) - static_cast<uint64_t>(*first);
  std::vector<int64_t> numbers;
  for (size_t bit = 0; bit < 8 * size; ++bit) {
    if ((bytes[bit / 8] >> bit % 8 & 1) == 0) continue;
    if (numbers.size() == limit || bit > last_bit) return std::nullopt;
    numbers.push_back(*first + static_cast<int64_t>(bit));
  }
  return numbers;
}

}  // namespace

std::string pack_numbers(const std::vector<int64_t>& numbers) {
  std::string runs = pack_runs(numbers);
  const bool ascend =
      std::ranges::adjacent_find(numbers, std::ranges::greater_equal()) == numbers.end();
  auto bits = ascend ? pack_bits(numbers, runs.size()) : std::nullopt;
  return bits ? *std::move(bits) : runs;
}

std::optional<std::vector<int64_t>> unpack_numbers(std::string_view text, size_t limit) {
  if (!text.starts_with(kBits)) return unpack_runs(text, limit);
  return unpack_bits(text.substr(kBits.size()), limit);
}

}  // namespace v3d::control
