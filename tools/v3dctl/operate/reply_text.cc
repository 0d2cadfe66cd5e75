#include "v3dctl/operate/reply_text.h"

#include <algorithm>
#include <cstdio>
#include <initializer_list>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/core/text.h"
#include "daemon/control/reply_json.h"
#include "take/take.h"
#include "v3dctl/operate/health_text.h"

namespace v3d::ctl {
namespace {

std::string_view outcome_name(wire::ReplyMessage::Outcome outcome) {
  switch (outcome) {
    case wire::ReplyMessage::Outcome::kPending:
      return "pending";
    case wire::ReplyMessage::Outcome::kDone:
      return "done";
    case wire::ReplyMessage::Outcome::kRefused:
      return "refused";
    case wire::ReplyMessage::Outcome::kNonceMissing:
      break;  // the client sends the command again
  }
  return "";
}

std::string padded(std::string text, size_t width) {
  if (text.size() < width) text.resize(width, ' ');
  return text;
}

// Consecutive nodes with equal replies.
struct NodeRange {
  std::string first, last, text;
};

std::string silent_node_text(const std::string& node,
                             const std::map<std::string, wire::HealthMessage>& health) {
  const auto found = health.find(node);
  if (found == health.end()) return "no reply. " + silent_node_advice(node);
  const std::string& text = found->second.text;
  return "no reply to commands" + (text.empty() ? ", but health messages" : ": " + text);
}

std::string reply_text(const wire::ReplyMessage& reply, const std::string& done_word) {
  if (reply.outcome == wire::ReplyMessage::Outcome::kRefused) return reply.text;
  const bool done = reply.outcome == wire::ReplyMessage::Outcome::kDone;
  return padded(done ? done_word : "pending", 9) + reply.text;
}

/// Limit of the numbers in the packed lists of one reply: those of 15 cameras that miss every pulse
/// of 6 hours at 60 Hz.
constexpr size_t kMaxUnpacked = 20'000'000;

/// Replaces the packed lists (pack_numbers()) with these names by lists of numbers. Leaves other
/// strings. `room`: numbers that may still be unpacked.
void unpack_lists(Json& json, std::initializer_list<const char*> names, size_t& room) {
  for (const char* name : names) {
    const auto list = json.find(name);
    if (list == json.end() || !list->is_string()) continue;
    const auto numbers = control::unpack_numbers(list->get_ref<const std::string&>(), room);
    if (!numbers) continue;
    room -= numbers->size();
    *list = *numbers;
  }
}

/// The JSON of a reply, with lists of numbers; discarded where the detail is no JSON.
Json parse_detail(const std::string& text) {
  Json detail = Json::parse(text, nullptr, false);
  if (!detail.is_object()) return detail;
  size_t room = kMaxUnpacked;
  unpack_lists(detail, {"without_mesh"}, room);
  if (const auto pulses = detail.find("pulses"); pulses != detail.end() && pulses->is_object()) {
    unpack_lists(*pulses, {"unsensed", "runt"}, room);
  }
  const auto cameras = detail.find("cameras");
  if (cameras == detail.end() || !cameras->is_array()) return detail;
  for (Json& camera : *cameras) {
    if (camera.is_object()) unpack_lists(camera, {"missing", "duplicate", "suspect"}, room);
  }
  return detail;
}

void read_numbers(const Json& from, const char* key, std::vector<int64_t>& to) {
  if (from.contains(key)) to = from.at(key).get<std::vector<int64_t>>();
}

// Throws a Json exception if the value is no count of pulses or frames.
int64_t read_count(const Json& json) {
  const auto n = json.get<double>();
  if (!(n >= 0 && n <= static_cast<double>(take::kMaxPulses))) {
    throw Json::other_error::create(501, "no count", nullptr);
  }
  return static_cast<int64_t>(n);
}

// Throws a Json exception if the value is no count of samples.
int64_t read_sample_count(const Json& json) {
  constexpr double kMaxSamples = 1e13;  // years
  const auto n = json.get<double>();
  if (!(n >= 0 && n <= kMaxSamples)) throw Json::other_error::create(501, "no count", nullptr);
  return static_cast<int64_t>(n);
}

// Throws a Json exception if the value is no list of sound files.
std::vector<take::SoundLedger> parse_sounds(const Json& json) {
  std::vector<take::SoundLedger> sounds;
  for (const Json& entry : json) {
    take::SoundLedger sound;
    sound.file = printable(entry.at("file").get<std::string>());
    sound.node = entry.at("node").get<std::string>();
    sound.samples = read_sample_count(entry.at("samples"));
    sound.map_source = entry.at("map_source").get<std::string>();
    sound.xruns = read_count(entry.at("xruns"));
    sound.lost_samples = read_sample_count(entry.at("lost_samples"));
    sound.missing_edges = read_count(entry.at("missing_edges"));
    sound.timecode_jumps = read_count(entry.at("timecode_jumps"));
    sounds.push_back(std::move(sound));
  }
  return sounds;
}

// Throws a Json exception if the value is no ledger.
take::Ledger parse_ledger(const Json& json) {
  take::Ledger ledger;
  ledger.take = json.at("take").get<std::string>();
  const Json& pulses = json.at("pulses");
  ledger.commanded = read_count(pulses.at("commanded"));
  ledger.commanded_is_minimum = pulses.value("commanded_is_minimum", false);
  if (!pulses.at("sensed").is_null()) ledger.sensed = read_count(pulses.at("sensed"));
  read_numbers(pulses, "unsensed", ledger.unsensed);
  read_numbers(pulses, "runt", ledger.runt);
  ledger.extra = pulses.contains("extra") ? read_count(pulses.at("extra")) : 0;
  for (const Json& entry : json.at("cameras")) {
    take::CameraLedger camera;
    camera.name = entry.at("name").get<std::string>();
    camera.received = read_count(entry.at("received"));
    camera.written = read_count(entry.at("written"));
    camera.published = read_count(entry.at("published"));
    camera.exposed = entry.contains("exposed") ? read_count(entry.at("exposed")) : camera.received;
    read_numbers(entry, "missing", camera.missing);
    read_numbers(entry, "duplicate", camera.duplicate);
    read_numbers(entry, "suspect", camera.suspect);
    ledger.cameras.push_back(camera);
  }
  if (json.contains("sounds")) ledger.sounds = parse_sounds(json.at("sounds"));
  for (const Json& node : json.value("nodes_without_sound", Json::array())) {
    ledger.nodes_without_sound.push_back(printable(node.get<std::string>()));
  }
  return ledger;
}

/// The name of the take in a reply without a ledger that can be read; empty where it has none.
std::string take_in(const Json& detail) {
  const auto take = detail.is_object() ? detail.find("take") : detail.end();
  return take != detail.end() && take->is_string() ? printable(take->get<std::string>()) : "";
}

/// Ledger of the expected cameras that no node reported. After a merge they miss every pulse.
take::Ledger ledger_of_unreported_cameras(const std::vector<std::string>& expected,
                                          const std::vector<take::Ledger>& parts) {
  const auto is_known = [&](const std::string& name) {
    return std::any_of(parts.begin(), parts.end(), [&](const take::Ledger& part) {
      return std::any_of(part.cameras.begin(), part.cameras.end(),
                         [&](const take::CameraLedger& camera) { return camera.name == name; });
    });
  };
  take::Ledger silent;
  for (const std::string& name : expected) {
    if (!is_known(name)) silent.cameras.emplace_back().name = name;
  }
  return silent;
}

/// Frames sent by each camera minus those that the reconstruction received. A node that restarted
/// in the take did not count the frames sent before, so its cameras have no entry.
std::map<std::string, int64_t> live_losses(const take::Ledger& ledger, const Json& reconstruction) {
  std::map<std::string, int64_t> lost;
  for (const take::CameraLedger& camera : ledger.cameras) {
    const auto received = reconstruction.find(camera.name + ".live_received");
    if (received == reconstruction.end()) continue;
    try {
      const int64_t lost_frames = camera.published - read_count(*received);
      if (lost_frames >= 0) lost[camera.name] = lost_frames;
    } catch (const Json::exception&) {
      continue;
    }
  }
  return lost;
}

/// Adds the counts of one of several reconstruction nodes. Throws a Json exception if one is
/// missing.
void add_shard(const std::string& node, const Json& detail, TakeAccount& account) {
  account.shards.push_back({.node = node,
                            .made = read_count(detail.at("shard_pulses")),
                            .taken_over = read_count(detail.at("shard_taken_over"))});
  const int64_t meshes = read_count(detail.at("meshes"));
  if (meshes < account.meshes) return;
  account.meshes = meshes;
  account.without_mesh = detail.at("without_mesh").get<std::vector<int64_t>>();
}

/// Keeps the larger value of each camera. All reconstruction nodes receive all cameras, so a frame
/// that reached one node is not lost.
void merge_maxima(const Json& detail, Json& maxima) {
  for (const auto& [name, value] : detail.items()) {
    const auto known = maxima.find(name);
    const bool is_less = known != maxima.end() && known->is_number() && value.is_number() &&
                         value.get<double>() < known->get<double>();
    if (!is_less) maxima[name] = value;
  }
}

/// Returns the ledgers of the take that most nodes report. A stop without a take name is answered
/// with the node's last take, which differs where a node took part in another one since.
std::vector<take::Ledger> select_take(
    const std::vector<std::pair<std::string, take::Ledger>>& ledgers, TakeAccount& account) {
  std::map<std::string, int> count;
  for (const auto& [node, ledger] : ledgers) ++count[ledger.take];
  const auto most_common = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<take::Ledger> parts;
  for (const auto& [node, ledger] : ledgers) {
    if (ledger.take == most_common->first) {
      parts.push_back(ledger);
      account.merged.push_back(node);
    } else {
      account.of_another_take.push_back(node);
    }
  }
  return parts;
}

}  // namespace

std::vector<std::string> reply_lines(const std::vector<std::string>& nodes,
                                     const control::Answer& answer, const std::string& done_word,
                                     const std::map<std::string, wire::HealthMessage>& health) {
  std::vector<NodeRange> lines;
  for (const std::string& node : nodes) {
    const auto reply = answer.replies.find(node);
    const bool silent =
        std::find(answer.silent.begin(), answer.silent.end(), node) != answer.silent.end();
    if (!silent && reply == answer.replies.end()) continue;
    const std::string text =
        silent ? silent_node_text(node, health) : reply_text(reply->second, done_word);
    if (!lines.empty() && lines.back().text == text) {
      lines.back().last = node;
    } else {
      lines.push_back({node, node, text});
    }
  }
  std::vector<std::string> texts;
  for (const NodeRange& line : lines) {
    const std::string names = line.first == line.last ? line.first : line.first + "-" + line.last;
    texts.push_back(padded(names, 12) + "  " + line.text);
  }
  return texts;
}

Json answer_json(const control::Answer& answer) {
  Json replies = Json::array();
  for (const auto& [node, reply] : answer.replies) {
    Json entry = {{"node", node}, {"outcome", outcome_name(reply.outcome)}, {"text", reply.text}};
    Json detail = parse_detail(reply.detail);
    if (detail.is_object()) entry["detail"] = std::move(detail);
    replies.push_back(std::move(entry));
  }
  return {{"done", answer.done()}, {"replies", replies}, {"silent", answer.silent}};
}

TakeAccount merge_ledgers(const control::Answer& answer, const std::vector<std::string>& expected) {
  TakeAccount account;
  std::vector<std::pair<std::string, take::Ledger>> ledgers;
  take::Ledger unread;  // of which only the name of the take is known
  Json reconstruction = Json::object();
  for (const auto& [node, reply] : answer.replies) {
    if (reply.detail.empty()) continue;
    const Json detail = parse_detail(reply.detail);
    try {
      if (detail.is_object() && !detail.contains("cameras")) {
        merge_maxima(detail, reconstruction);
        if (detail.contains("shard_pulses")) add_shard(node, detail, account);
        continue;
      }
      ledgers.emplace_back(node, parse_ledger(detail));
    } catch (const Json::exception&) {
      account.unreadable.push_back(node);
      if (unread.take.empty()) unread.take = take_in(detail);
    }
  }
  account.is_counted = !ledgers.empty();
  std::vector<take::Ledger> parts = select_take(ledgers, account);
  if (!expected.empty()) parts.insert(parts.begin(), ledger_of_unreported_cameras(expected, parts));
  if (!account.is_counted) parts.push_back(std::move(unread));
  account.ledger = merge(parts);
  account.live_lost = live_losses(account.ledger, reconstruction);
  return account;
}

std::vector<std::string> cameras_without_ledger(const Studio& studio, const TakeAccount& account) {
  const auto& merged = account.merged;
  std::vector<std::string> names;
  for (const StudioCamera& camera : studio.cameras) {
    if (std::find(merged.begin(), merged.end(), camera.node) == merged.end())
      names.push_back(camera.name);
  }
  return names;
}

bool is_of_all_nodes(const TakeAccount& account, const control::Answer& answer) {
  return answer.done() && account.of_another_take.empty() && account.unreadable.empty();
}

bool is_whole(const TakeAccount& account, const control::Answer& answer) {
  if (!account.is_recorded()) return true;
  return account.ledger.complete() && is_of_all_nodes(account, answer);
}

std::vector<std::string> account_lines(const TakeAccount& account) {
  if (!account.is_recorded()) return {"nothing was recorded"};
  if (!account.is_counted) {
    return {"take " + account.ledger.take +
            ": no ledger can be read; v3dctl verify, on each node, lists its frames"};
  }
  std::vector<std::string> lines = problem_lines(account.ledger);
  lines.push_back(account.ledger.verdict());
  for (const std::string& line : {live_loss_line(account), shards_line(account)}) {
    if (!line.empty()) lines.push_back(line);
  }
  return lines;
}

std::string live_loss_line(const TakeAccount& account) {
  int64_t sent = 0;
  int64_t lost = 0;
  std::string cameras;
  for (const take::CameraLedger& camera : account.ledger.cameras) {
    const auto found = account.live_lost.find(camera.name);
    if (found == account.live_lost.end()) continue;
    sent += camera.published;
    lost += found->second;
    if (found->second == 0) continue;
    cameras += (cameras.empty() ? ": " : ", ") + camera.name + " " + format_count(found->second);
  }
  if (lost == 0) return "";
  return "live: " + format_count(lost) + " of " + format_count(sent) +
         " frames lost on the network" + cameras;
}

std::string shards_line(const TakeAccount& account) {
  if (account.shards.empty()) return "";
  std::string line = "meshes: " + format_count(account.meshes);
  for (const ShardAccount& shard : account.shards) {
    line += ", " + shard.node + " " + format_count(shard.made);
    if (shard.taken_over > 0) line += " (" + format_count(shard.taken_over) + " taken over)";
  }
  if (account.without_mesh.empty()) return line;
  return line + "; no mesh of " + take::number_ranges(account.without_mesh);
}

Json shards_json(const TakeAccount& account) {
  Json nodes = Json::array();
  for (const ShardAccount& shard : account.shards) {
    nodes.push_back({{"node", shard.node}, {"made", shard.made}, {"taken_over", shard.taken_over}});
  }
  return {{"meshes", account.meshes}, {"without_mesh", account.without_mesh}, {"nodes", nodes}};
}

Json to_json(const take::Ledger& ledger) { return Json::parse(control::ledger_json(ledger)); }

}  // namespace v3d::ctl
