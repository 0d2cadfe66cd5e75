#include "v3dctl/operate/reply_text.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/units.h"
#include "daemon/json.h"
#include "take/take.h"
#include "v3dctl/operate/health_text.h"

namespace v3d::ctl {
namespace {

std::string_view word(ReplyMessage::Outcome outcome) {
  switch (outcome) {
    case ReplyMessage::Outcome::kPending:
      return "pending";
    case ReplyMessage::Outcome::kDone:
      return "done";
    case ReplyMessage::Outcome::kRefused:
      return "refused";
    case ReplyMessage::Outcome::kNonceMissing:
      break;  // the client sends the command again
  }
  return "";
}

std::string padded(std::string text, size_t width) {
  if (text.size() < width) text.resize(width, ' ');
  return text;
}

// What is said, and by which neighbours.
struct Line {
  std::string first, last, text;
};

std::string text_of_silent(const std::string& node,
                           const std::map<std::string, HealthMessage>& health) {
  const auto heard = health.find(node);
  if (heard == health.end()) {
    return "no answer. Try: systemctl status v3d-studio.target on " + node;
  }
  const std::string& text = heard->second.text;
  return "no answer to commands" + (text.empty() ? ", though it reports" : ": " + text);
}

std::string text_of(const ReplyMessage& reply, const std::string& done_word) {
  if (reply.outcome == ReplyMessage::Outcome::kRefused) return reply.text;
  const bool done = reply.outcome == ReplyMessage::Outcome::kDone;
  return padded(done ? done_word : "pending", 9) + reply.text;
}

void put_ledger_numbers(const Json& from, const char* key, std::vector<int64_t>& to) {
  if (from.contains(key)) to = from.at(key).get<std::vector<int64_t>>();
}

// Throws a Json exception for anything that is not a count of pulses or frames.
int64_t count_in(const Json& json) {
  const auto n = json.get<double>();
  if (!(n >= 0 && n <= static_cast<double>(kMostPulses))) {
    throw Json::other_error::create(501, "no count", nullptr);
  }
  return static_cast<int64_t>(n);
}

// Throws a Json exception for anything that is not a ledger.
Ledger parse_ledger(const Json& json) {
  Ledger ledger;
  ledger.take = json.at("take").get<std::string>();
  const Json& pulses = json.at("pulses");
  ledger.commanded = count_in(pulses.at("commanded"));
  if (!pulses.at("sensed").is_null()) ledger.sensed = count_in(pulses.at("sensed"));
  put_ledger_numbers(pulses, "unsensed", ledger.unsensed);
  put_ledger_numbers(pulses, "runt", ledger.runt);
  ledger.extra = pulses.contains("extra") ? count_in(pulses.at("extra")) : 0;
  for (const Json& entry : json.at("cameras")) {
    CameraLedger camera;
    camera.name = entry.at("name").get<std::string>();
    camera.received = count_in(entry.at("received"));
    camera.written = count_in(entry.at("written"));
    camera.published = count_in(entry.at("published"));
    camera.exposed = entry.contains("exposed") ? count_in(entry.at("exposed")) : camera.received;
    put_ledger_numbers(entry, "missing", camera.missing);
    put_ledger_numbers(entry, "duplicate", camera.duplicate);
    put_ledger_numbers(entry, "suspect", camera.suspect);
    ledger.cameras.push_back(camera);
  }
  return ledger;
}

double greatest(const std::map<std::string, HealthMessage>& health, const std::string& value) {
  double most = 0;
  for (const auto& [node, message] : health) {
    const auto found = message.values.find(value);
    if (found != message.values.end()) most = std::max(most, found->second);
  }
  return most;
}

}  // namespace

std::vector<std::string> reply_lines(const std::vector<std::string>& nodes, const Answer& answer,
                                     const std::string& done_word,
                                     const std::map<std::string, HealthMessage>& health) {
  std::vector<Line> lines;
  for (const std::string& node : nodes) {
    const auto said = answer.replies.find(node);
    const bool silent =
        std::find(answer.silent.begin(), answer.silent.end(), node) != answer.silent.end();
    if (!silent && said == answer.replies.end()) continue;
    const std::string text =
        silent ? text_of_silent(node, health) : text_of(said->second, done_word);
    if (!lines.empty() && lines.back().text == text) {
      lines.back().last = node;
    } else {
      lines.push_back({node, node, text});
    }
  }
  std::vector<std::string> texts;
  for (const Line& line : lines) {
    const std::string who = line.first == line.last ? line.first : line.first + "-" + line.last;
    texts.push_back(padded(who, 12) + "  " + line.text);
  }
  return texts;
}

Json answer_json(const Answer& answer) {
  Json replies = Json::array();
  for (const auto& [node, reply] : answer.replies) {
    Json said = {{"node", node}, {"outcome", word(reply.outcome)}, {"text", reply.text}};
    const Json detail = Json::parse(reply.detail, nullptr, false);
    if (detail.is_object()) said["detail"] = detail;
    replies.push_back(std::move(said));
  }
  return {{"done", answer.done()}, {"replies", replies}, {"silent", answer.silent}};
}

namespace {

/// That of cameras of which nobody gave one: merged with those of others, they miss every pulse.
Ledger account_of_the_silent(const std::vector<std::string>& expected,
                             const std::vector<Ledger>& parts) {
  const auto is_known = [&](const std::string& name) {
    return std::any_of(parts.begin(), parts.end(), [&](const Ledger& part) {
      return std::any_of(part.cameras.begin(), part.cameras.end(),
                         [&](const CameraLedger& camera) { return camera.name == name; });
    });
  };
  Ledger silent;
  for (const std::string& name : expected) {
    if (!is_known(name)) silent.cameras.emplace_back().name = name;
  }
  return silent;
}

/// What the cameras sent, less what the reconstruction says that it got. A node that was started
/// anew in the take has not counted what it sent before: of its cameras nothing is said.
std::map<std::string, int64_t> live_lost_of(const Ledger& ledger, const Json& reconstruction) {
  std::map<std::string, int64_t> lost;
  for (const CameraLedger& camera : ledger.cameras) {
    const auto received = reconstruction.find(camera.name + ".live_received");
    if (received == reconstruction.end()) continue;
    try {
      const int64_t lost_frames = camera.published - count_in(*received);
      if (lost_frames >= 0) lost[camera.name] = lost_frames;
    } catch (const Json::exception&) {
      continue;
    }
  }
  return lost;
}

}  // namespace

namespace {

/// What one of several nodes did. Throws a Json exception where a count is none.
void add_shard(const std::string& node, const Json& detail, TakeAccount& account) {
  account.shards.push_back({.node = node,
                            .made = count_in(detail.at("shard_pulses")),
                            .taken_over = count_in(detail.at("shard_taken_over"))});
  const int64_t meshes = count_in(detail.at("meshes"));
  if (meshes < account.meshes) return;
  account.meshes = meshes;
  account.without_mesh = detail.at("without_mesh").get<std::vector<int64_t>>();
}

/// Every node that reconstructs hears all cameras: what reached one of them counts.
void keep_most(const Json& detail, Json& most) {
  for (const auto& [name, value] : detail.items()) {
    const auto known = most.find(name);
    const bool is_less = known != most.end() && known->is_number() && value.is_number() &&
                         value.get<double>() < known->get<double>();
    if (!is_less) most[name] = value;
  }
}

}  // namespace

namespace {

/// A stop that names no take is answered by each node for its last one. These differ where a node
/// was ordered something since that the others were not.
std::vector<Ledger> ledgers_of_one_take(const std::vector<std::pair<std::string, Ledger>>& ledgers,
                                        TakeAccount& account) {
  std::map<std::string, int> count;
  for (const auto& [node, ledger] : ledgers) ++count[ledger.take];
  const auto most = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<Ledger> parts;
  for (const auto& [node, ledger] : ledgers) {
    if (ledger.take == most->first) {
      parts.push_back(ledger);
    } else {
      account.of_another_take.push_back(node);
    }
  }
  return parts;
}

}  // namespace

TakeAccount merge_ledgers(const Answer& answer, const std::vector<std::string>& expected) {
  TakeAccount account;
  std::vector<std::pair<std::string, Ledger>> ledgers;
  Json reconstruction = Json::object();
  for (const auto& [node, reply] : answer.replies) {
    if (reply.detail.empty()) continue;
    try {
      const Json detail = Json::parse(reply.detail);
      if (detail.is_object() && !detail.contains("cameras")) {
        keep_most(detail, reconstruction);
        if (detail.contains("shard_pulses")) add_shard(node, detail, account);
        continue;
      }
      ledgers.emplace_back(node, parse_ledger(detail));
    } catch (const Json::exception&) {
      account.unreadable.push_back(node);
    }
  }
  std::vector<Ledger> parts = ledgers_of_one_take(ledgers, account);
  if (!expected.empty()) parts.insert(parts.begin(), account_of_the_silent(expected, parts));
  account.ledger = merge(parts);
  account.live_lost = live_lost_of(account.ledger, reconstruction);
  return account;
}

std::string live_line(const TakeAccount& account) {
  int64_t sent = 0;
  int64_t lost = 0;
  std::string cameras;
  for (const CameraLedger& camera : account.ledger.cameras) {
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
  return line + "; no mesh of " + number_ranges(account.without_mesh);
}

Json shards_json(const TakeAccount& account) {
  Json nodes = Json::array();
  for (const ShardAccount& shard : account.shards) {
    nodes.push_back({{"node", shard.node}, {"made", shard.made}, {"taken_over", shard.taken_over}});
  }
  return {{"meshes", account.meshes}, {"without_mesh", account.without_mesh}, {"nodes", nodes}};
}

Json to_json(const Ledger& ledger) { return Json::parse(ledger_json(ledger)); }

std::vector<std::string> status_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, HealthMessage>& health) {
  std::vector<std::string> lines;
  for (const std::string& node : nodes) {
    const auto found = health.find(node);
    if (found == health.end()) {
      lines.push_back(padded(node, 12) + "  silent. Try: systemctl status v3d-studio.target on " +
                      node);
      continue;
    }
    const HealthMessage& message = found->second;
    std::string line = padded(node, 12) + "  " + padded(message.program, 12) + "  " +
                       padded(std::string(name(message.state)), 9);
    if (!message.take.empty()) line += "  " + message.take;
    if (!message.text.empty()) line += "  " + message.text;
    while (line.ends_with(' ')) line.pop_back();
    lines.push_back(line);
  }
  return lines;
}

Json health_json(const std::vector<std::string>& nodes,
                 const std::map<std::string, HealthMessage>& health) {
  Json list = Json::array();
  for (const std::string& node : nodes) {
    const auto found = health.find(node);
    if (found == health.end()) {
      list.push_back({{"node", node}, {"state", "silent"}});
      continue;
    }
    const HealthMessage& message = found->second;
    list.push_back({{"node", node},
                    {"program", message.program},
                    {"version", message.version},
                    {"state", name(message.state)},
                    {"take", message.take},
                    {"text", message.text},
                    {"values", message.values}});
  }
  return {{"well", all_well(nodes, health)}, {"nodes", list}};
}

bool all_well(const std::vector<std::string>& nodes,
              const std::map<std::string, HealthMessage>& health) {
  return std::all_of(nodes.begin(), nodes.end(), [&](const std::string& node) {
    const auto found = health.find(node);
    return found != health.end() && found->second.state != NodeState::kFault;
  });
}

bool all_heard(const std::vector<std::string>& nodes,
               const std::map<std::string, HealthMessage>& health) {
  return std::all_of(nodes.begin(), nodes.end(),
                     [&](const std::string& node) { return health.contains(node); });
}

bool is_at_work(const HealthMessage& health) {
  return health.state == NodeState::kRecording || health.state == NodeState::kDraining;
}

std::optional<double> total(const std::map<std::string, HealthMessage>& health,
                            const std::string& name) {
  std::optional<double> sum;
  for (const auto& [node, message] : health) {
    const auto found = message.values.find(name);
    if (found != message.values.end()) sum = sum.value_or(0) + found->second;
  }
  return sum;
}

std::string recording_line(const std::map<std::string, HealthMessage>& health) {
  const auto count = [](double value) { return value_text("", value); };
  std::string line;
  const auto add = [&](const std::string& part) { line += (line.empty() ? "" : "   ") + part; };
  if (total(health, "pulses_sensed")) {
    add(count(greatest(health, "pulses_sensed")) + " pulses");
  } else if (total(health, "pulses_commanded")) {
    add(count(greatest(health, "pulses_commanded")) + " pulses, not sensed");
  }
  if (const auto alive = total(health, "cameras_streaming")) {
    add(count(*alive) + "/" + count(total(health, "cameras").value_or(*alive)) + " cameras");
  }
  if (const auto missing = total(health, "frames_missing")) add(count(*missing) + " missing");
  if (total(health, "live_fps")) {  // of the stream, where several nodes make it
    char text[64];
    std::snprintf(text, sizeof text, "live %.1f/s, %.0f ms", greatest(health, "live_fps"),
                  greatest(health, "latency_p50_ms"));
    add(text);
    if (total(health, "silhouette_iou_percent")) {
      add(value_text("_percent", greatest(health, "silhouette_iou_percent")) + " explained");
    }
  }
  return line;
}

}  // namespace v3d::ctl
