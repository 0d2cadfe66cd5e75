#include "base/config/studio_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <limits>

#include "base/config/studio_fields.h"
#include "base/config/studio_values.h"
#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"

namespace v3d {
namespace {

/// `made_by`: the command that prints such keys, for the message.
std::string read_public_key(const TomlTable& table, std::string_view field,
                            const std::string& made_by) {
  constexpr size_t kDigits = 64;
  std::string key = table.text_or(field, "");
  const bool is_key =
      key.size() == kDigits && key.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!key.empty() && !is_key) {
    table.fail(field, "expected 64 hexadecimal digits, as " + made_by + " prints them");
  }
  return key;
}

void read_nodes(const TomlTable& file, Studio& studio) {
  for (const TomlTable& table : file.tables("node")) {
    const std::string name = read_name(table);
    if (has_node(studio, name)) {
      table.fail("name", "two nodes are named '" + name + "'");
    }
    studio.nodes.push_back({name, read_public_key(table, "public_key", "v3dctl key node")});
    table.reject_unknown_fields();
  }
  if (studio.nodes.empty()) {
    file.fail("node", "missing: expected one [[node]] per PC");
  }
}

StudioLine read_line(const TomlTable& table) {
  StudioLine line;
  line.chip = table.text("chip");
  if (!table.has("line")) {
    table.fail("line",
               "missing: expected the name or the number of a line, as gpioinfo lists them");
  }
  line.line = table.is_text("line") ? table.text("line")
                                    : std::to_string(ranged_int(table, "line", 0, 0, 65'535));
  return line;
}

StudioLine read_sense(const TomlTable& table) {
  static constexpr std::array<std::pair<std::string_view, bool>, 2> kEdges = {
      {{"rising", false}, {"falling", true}}};
  StudioLine line = read_line(table);
  line.active_low = choice(table, "edge", "rising", kEdges);
  table.reject_unknown_fields();
  return line;
}

StudioLine read_driven_line(const TomlTable& table) {
  StudioLine line = read_line(table);
  line.active_low = table.boolean_or("active_low", false);
  return line;
}

/// Parses four hexadecimal digits, as lsusb prints them.
std::optional<uint16_t> usb_number(std::string_view text) {
  uint16_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return text.size() == 4 && whole ? std::optional(value) : std::nullopt;
}

/// A standard speed of serial ports, baud.
int read_baud(const TomlTable& table, int fallback) {
  static constexpr std::array<int64_t, 8> kSpeeds = {4800,   9600,    19'200,  38'400,
                                                     57'600, 115'200, 230'400, 460'800};
  const int64_t value = table.integer_or("baud", fallback);
  if (std::find(kSpeeds.begin(), kSpeeds.end(), value) == kSpeeds.end()) {
    table.fail("baud",
               "expected 4800, 9600, 19200, 38400, 57600, 115200, 230400 or 460800, found " +
                   std::to_string(value));
  }
  return static_cast<int>(value);
}

StudioInstrument read_instrument(const TomlTable& table) {
  constexpr std::string_view kSerial = "serial:/";
  constexpr std::string_view kUsb = "usb:";
  const std::string text = table.text("instrument");
  const std::string_view rest = text;
  StudioInstrument instrument;
  if (rest.starts_with(kSerial) && rest.size() > kSerial.size()) {
    instrument.device = rest.substr(kSerial.size() - 1);
    instrument.baud = read_baud(table, instrument.baud);
    return instrument;
  }
  constexpr size_t kProduct = kUsb.size() + 5;
  const auto vendor = usb_number(rest.substr(std::min(rest.size(), kUsb.size()), 4));
  const auto product = usb_number(rest.substr(std::min(rest.size(), kProduct), 4));
  const bool ends_after_product = rest.size() == kProduct + 4;
  const bool has_serial = rest.size() > kProduct + 5 && rest[kProduct + 4] == ':';
  if (!rest.starts_with(kUsb) || !vendor || !product || rest[kProduct - 1] != ':' ||
      (!ends_after_product && !has_serial)) {
    table.fail("instrument", "'" + text + "': expected usb:VVVV:PPPP, usb:VVVV:PPPP:SERIAL " +
                                 "(numbers as lsusb writes them) or serial:/dev/NAME");
  }
  instrument.vendor = *vendor;
  instrument.product = *product;
  if (has_serial) instrument.serial = rest.substr(kProduct + 5);
  return instrument;
}

void read_scpi(const TomlTable& table, StudioTrigger& trigger) {
  static constexpr std::array<std::pair<std::string_view, Dialect>, 4> kDialects = {
      {{"keysight33500", Dialect::kKeysight33500},
       {"rigol-dg", Dialect::kRigolDg},
       {"siglent-sdg", Dialect::kSiglentSdg},
       {"bnc575", Dialect::kBnc575}}};
  trigger.instrument = read_instrument(table);
  trigger.dialect = choice(table, "dialect", "", kDialects);
  trigger.channel = ranged_int(table, "channel", trigger.channel, 1, 8);
  trigger.level_v = ranged(table, "level_v", trigger.level_v, 0.5, 10);
  if (table.has("gate")) {
    const TomlTable gate = table.table("gate");
    trigger.gate = read_driven_line(gate);
    gate.reject_unknown_fields();
  }
}

void read_trigger(const TomlTable& file, Studio& studio) {
  static constexpr std::array<std::pair<std::string_view, TriggerKind>, 4> kKinds = {
      {{"action", TriggerKind::kAction},
       {"gpio", TriggerKind::kGpio},
       {"scpi", TriggerKind::kScpi},
       {"simulated", TriggerKind::kSimulated}}};
  const TomlTable table = file.table("trigger");
  StudioTrigger& trigger = studio.trigger;
  trigger.node = read_node(table, studio);
  trigger.kind = choice(table, "kind", "simulated", kKinds);
  trigger.rate_hz = ranged(table, "rate_hz", trigger.rate_hz, kMinPulseRateHz, kMaxPulseRateHz);
  trigger.pulse_width_us = ranged(table, "pulse_width_us", trigger.pulse_width_us, 0.1, 1e6);
  if (trigger.pulse_width_us >= 1e6 / trigger.rate_hz) {
    table.fail("pulse_width_us", "a pulse must be shorter than the period of " +
                                     format_plain(1e6 / trigger.rate_hz) + " us");
  }
  if (trigger.kind == TriggerKind::kSimulated) {
    trigger.wire = resolve(studio, table.text("wire"));
  } else if (trigger.kind != TriggerKind::kAction && table.has("sense")) {
    trigger.sense = read_sense(table.table("sense"));
  }
  if (trigger.kind == TriggerKind::kGpio) trigger.output = read_driven_line(table);
  if (trigger.kind == TriggerKind::kScpi) read_scpi(table, trigger);
  if (trigger.kind == TriggerKind::kAction) read_action(table, trigger);
  table.reject_unknown_fields();
}

/// Free-running cameras need a sense line on their own node: the frames get the numbers of the
/// sensed pulses, by one clock.
void require_sensed_trigger(const TomlTable& file, const Studio& studio) {
  const auto tables = file.tables("camera");
  for (size_t i = 0; i < tables.size(); ++i) {
    const StudioCamera& camera = studio.cameras[i];
    if (!camera.is_free_running()) continue;
    const std::string prefix = "missing, so " + camera.name + " is free-running; ";
    if (camera.node != studio.trigger.node) {
      tables[i].fail("trigger_control", prefix + "connect it to the trigger's node, " +
                                            studio.trigger.node +
                                            ", whose sense line numbers its frames");
    }
    if (!studio.trigger.is_sensed()) {
      tables[i].fail("trigger_control", prefix + "add [trigger.sense], which numbers its frames");
    }
  }
}

void read_space(const TomlTable& file, Studio& studio) {
  const TomlTable table = file.table("space");
  studio.space.bounds = {read_point(table, "min"), read_point(table, "max")};
  if ((studio.space.bounds.size().array() <= 0).any()) {
    table.fail("max", "expected values above min in x, y and z");
  }
  table.reject_unknown_fields();
}

/// Each group needs its own port: a socket receives all groups of its port that any process of its
/// PC has joined.
void read_frame_groups(const TomlTable& table, StudioNetwork& network) {
  if (!table.has("frame_groups")) return;
  network.frame_groups = table.texts("frame_groups");
  std::vector<std::string> urls = {network.lcm_url};
  for (const std::string& url : network.frame_groups) {
    const auto group = lcm_group(url);
    if (!group) {
      table.fail(
          "frame_groups",
          "'" + url + "' is not a multicast group; expected one like udpm://239.255.76.68:7668");
    }
    for (const std::string& other : urls) {
      const auto taken = lcm_group(other);
      if (!taken || (group->address != taken->address && group->port != taken->port)) continue;
      table.fail("frame_groups",
                 "'" + url + "' and '" + other +
                     "' share an address or a port; use different ones for each group");
    }
    urls.push_back(url);
  }
}

void read_members(const TomlTable& table, Studio& studio) {
  StudioNetwork& network = studio.network;
  network.operator_key =
      resolve(studio, table.text_or("operator_key", network.operator_key.string()));
  network.authority = read_public_key(table, "authority", "v3dctl key authority");
  if (!table.has("members")) return;
  network.members = resolve(studio, table.text("members"));
  if (network.authority.empty()) {
    table.fail("authority", "missing: a member list needs the public key that verifies it");
  }
}

void read_network(const TomlTable& file, Studio& studio) {
  if (!file.has("network")) {
    return;
  }
  const TomlTable table = file.table("network");
  studio.network.lcm_url = table.text_or("lcm_url", studio.network.lcm_url);
  read_frame_groups(table, studio.network);
  studio.network.key = resolve(studio, table.text_or("key", studio.network.key.string()));
  read_members(table, studio);
  studio.network.metrics = table.text_or("metrics", studio.network.metrics);
  table.reject_unknown_fields();
}

void read_storage(const TomlTable& file, Studio& studio) {
  const TomlTable table = file.table("storage");
  studio.storage.takes = resolve(studio, table.text("takes"));
  studio.storage.background = resolve(studio, table.text("background"));
  studio.storage.calib = resolve(studio, table.text("calib"));
  if (table.has("signing_key")) {
    studio.storage.signing_key = resolve(studio, table.text("signing_key"));
  } else if (!studio.network.members.empty()) {
    table.fail("signing_key",
               "missing: with a member list, nodes need this key to sign their replies");
  }
  table.reject_unknown_fields();
}

/// The field `node`, or `nodes` when several nodes share the pulses.
std::vector<std::string> read_reconstruction_nodes(const TomlTable& table, const Studio& studio) {
  if (!table.has("nodes")) return {read_node(table, studio)};
  if (table.has("node")) table.fail("node", "expected either node or nodes, found both");
  std::vector<std::string> nodes = table.texts("nodes");
  if (nodes.empty()) table.fail("nodes", "expected the names of [[node]]s, found none");
  for (const std::string& node : nodes) require_node(table, "nodes", studio, node);
  std::sort(nodes.begin(), nodes.end());
  const auto duplicate = std::adjacent_find(nodes.begin(), nodes.end());
  if (duplicate != nodes.end()) table.fail("nodes", "'" + *duplicate + "' is listed twice");
  return nodes;
}

/// A node that shares a take ends its wait for any mesh after 15 s.
constexpr int kMaxSharedDeadlineMs = 10'000;

void read_reconstruction(const TomlTable& file, Studio& studio) {
  static constexpr std::array<std::pair<std::string_view, Quality>, 3> kQualities = {
      {{"live", Quality::kLive}, {"medium", Quality::kMedium}, {"high", Quality::kHigh}}};
  const TomlTable table = file.table("reconstruction");
  StudioReconstruction& r = studio.reconstruction;
  r.nodes = read_reconstruction_nodes(table, studio);
  r.voxel_m = ranged(table, "voxel_m", r.voxel_m, 1e-4, 1);
  const int cameras = static_cast<int>(studio.cameras.size());
  r.min_views = ranged_int(table, "min_views", std::min(r.min_views, cameras), 1, cameras);
  r.quality = choice(table, "quality", "medium", kQualities);
  r.threads = ranged_int(table, "threads", r.threads, 0, 1024);
  r.deadline_ms = ranged(table, "deadline_ms", r.deadline_ms, 1, 60'000);
  if (r.nodes.size() > 1 && r.deadline_ms > kMaxSharedDeadlineMs) {
    table.fail("deadline_ms", fmt::format("expected at most {} with {} reconstruction nodes",
                                          kMaxSharedDeadlineMs, r.nodes.size()));
  }
  r.repair = table.boolean_or("repair", r.repair);
  r.performers = table.boolean_or("performers", r.performers);
  if (r.performers && r.nodes.size() > 1) {
    table.fail("performers",
               fmt::format("expected false with {} reconstruction nodes: each sees only its own "
                           "pulses; run v3dctl performers after the take",
                           r.nodes.size()));
  }
  table.reject_unknown_fields();
}

void read_viewer(const TomlTable& file, Studio& studio) {
  if (!file.has("viewer")) {
    return;
  }
  const TomlTable table = file.table("viewer");
  studio.viewer.listen = table.text_or("listen", studio.viewer.listen);
  if (table.has("token")) studio.viewer.token = resolve(studio, table.text("token"));
  studio.viewer.page = resolve(studio, table.text_or("page", studio.viewer.page.string()));
  studio.viewer.control = table.boolean_or("control", studio.viewer.control);
  studio.viewer.operator_token =
      resolve(studio, table.text_or("operator_token", studio.viewer.operator_token.string()));
  table.reject_unknown_fields();
}

/// Throws InputError for a name in the tables [[key]] that is too long for the channel of a
/// message.
void reject_long_names(const TomlTable& file, std::string_view key, size_t max_characters) {
  for (const TomlTable& table : file.tables(key)) {
    const std::string name = table.text("name");
    if (name.size() <= max_characters) continue;
    table.fail("name", fmt::format("'{}' has {} characters; expected at most {}", name, name.size(),
                                   max_characters));
  }
}

Studio read_studio(const TomlTable& file, const std::filesystem::path& path) {
  Studio studio;
  studio.path = path;
  studio.name = read_name(file);
  read_nodes(file, studio);
  read_cameras(file, studio);
  read_trigger(file, studio);
  assign_action_cameras(file, studio);
  require_sensed_trigger(file, studio);
  read_space(file, studio);
  read_network(file, studio);
  read_storage(file, studio);
  read_reconstruction(file, studio);
  read_viewer(file, studio);
  read_sounds(file, studio);
  read_timecode_output(file, studio);
  read_lights(file, studio);
  file.reject_unknown_fields();
  return studio;
}

}  // namespace

std::string StudioInstrument::text() const {
  if (!device.empty()) return "serial:" + device.string();
  const std::string numbers = fmt::format("usb:{:04x}:{:04x}", vendor, product);
  return numbers + (serial.empty() ? "" : ":" + serial);
}

std::vector<StudioCamera> Studio::cameras_of(std::string_view node) const {
  std::vector<StudioCamera> found;
  std::copy_if(cameras.begin(), cameras.end(), std::back_inserter(found),
               [&](const StudioCamera& c) { return c.node == node; });
  return found;
}

const StudioSound* Studio::sound_of(std::string_view node) const {
  const auto found = std::ranges::find(sounds, node, &StudioSound::node);
  return found == sounds.end() ? nullptr : &*found;
}

bool Studio::reconstructs(std::string_view node) const {
  return std::find(reconstruction.nodes.begin(), reconstruction.nodes.end(), node) !=
         reconstruction.nodes.end();
}

Studio parse_studio(std::string_view text, const std::filesystem::path& path) {
  const TomlTable file = TomlTable::parse(text, path);
  Studio studio = read_studio(file, path);
  reject_long_names(file, "camera", kMaxCameraName);
  reject_long_names(file, "node", kMaxNodeName);
  return studio;
}

Studio parse_recorded_studio(std::string_view text, const std::filesystem::path& path) {
  return read_studio(TomlTable::parse(text, path), path);
}

Studio load_studio(const std::filesystem::path& path) {
  return parse_studio(io::value_or_throw(io::read_file(path, kMaxTakeTextBytes)), path);
}

}  // namespace v3d
