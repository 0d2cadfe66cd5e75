// Devices of a studio file other than cameras: [lights], [[sound]], [timecode_output], the action
// trigger.
#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "base/config/studio_fields.h"
#include "base/config/studio_file.h"
#include "base/config/toml_file.h"

namespace v3d {
namespace {

/// Values of the channels 1, 2, ...
std::vector<uint8_t> read_scene(const TomlTable& table, std::string_view scene) {
  constexpr size_t kMaxValues = 512;
  const std::vector<int64_t> values = table.integers(scene);
  if (values.empty() || values.size() > kMaxValues) {
    table.fail(scene, "expected the values of 1 to 512 DMX channels, found " +
                          std::to_string(values.size()));
  }
  std::vector<uint8_t> channels;
  for (const int64_t value : values) {
    if (value < 0 || value > 255) {
      table.fail(scene, "expected values from 0 to 255, found " + std::to_string(value));
    }
    channels.push_back(static_cast<uint8_t>(value));
  }
  return channels;
}

StudioLights read_lamps(const TomlTable& table, const Studio& studio) {
  StudioLights lights;
  lights.node = table.has("node") ? read_node(table, studio) : studio.trigger.node;
  if (studio.cameras_of(lights.node).empty() && studio.trigger.node != lights.node) {
    table.fail("node", "'" + lights.node +
                           "' has neither a camera nor the trigger; expected a node of "
                           "v3d-captured");
  }
  lights.universe = ranged_int(table, "universe", lights.universe, 0, 65'535);
  lights.work = read_scene(table, "work");
  lights.take = read_scene(table, "take");
  if (lights.work.size() != lights.take.size()) {
    table.fail("take", "expected as many channels as work has, " +
                           std::to_string(lights.work.size()) + ", found " +
                           std::to_string(lights.take.size()));
  }
  lights.settle_ms = ranged(table, "settle_ms", lights.settle_ms, 0, 10'000);
  table.reject_unknown_fields();
  return lights;
}

}  // namespace

void read_lights(const TomlTable& file, Studio& studio) {
  if (file.has("lights")) studio.lights = read_lamps(file.table("lights"), studio);
}

// [[sound]] and [timecode_output] of a studio file.

namespace {

constexpr int kMaxChannels = 64;

int read_rate(const TomlTable& table, int fallback) {
  static constexpr std::array<int64_t, 3> kRates = {48'000, 96'000, 44'100};
  const int64_t rate = table.integer_or("rate_hz", fallback);
  if (std::ranges::find(kRates, rate) == kRates.end()) {
    table.fail("rate_hz", "expected 48000, 96000 or 44100, found " + std::to_string(rate));
  }
  return static_cast<int>(rate);
}

/// A channel from 1 on; 0 where the field is missing.
int read_channel(const TomlTable& table, std::string_view key, int channels) {
  return table.has(key) ? ranged_int(table, key, 0, 1, channels) : 0;
}

// The names of sound/timecode.h, which tests compare.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kTimecodeRates = {
    {{"24", "24"},
     {"25", "25"},
     {"29.97", "29.97"},
     {"29.97df", "29.97df"},
     {"30", "30"},
     {"auto", ""}}};

/// The name of a rate of timecode, or empty.
std::string read_timecode_rate(const TomlTable& table) {
  return std::string(choice(table, "timecode_rate", "auto", kTimecodeRates));
}

/// The same, where no signal tells the rate.
std::string read_output_rate(const TomlTable& table) {
  std::array<std::pair<std::string_view, std::string_view>, kTimecodeRates.size() - 1> rates;
  std::copy_n(kTimecodeRates.begin(), rates.size(), rates.begin());
  return std::string(choice(table, "timecode_rate", "25", rates));
}

/// A timecode that exists at the rate; empty for "time of day". sound/timecode.h has the rules.
std::string read_start(const TomlTable& table, const std::string& rate) {
  const std::string text = table.text_or("start", "time of day");
  if (text == "time of day") return "";
  const bool drops = rate == "29.97df";
  const int frames = rate == "24" || rate == "25" ? std::stoi(rate) : 30;
  std::array<int, 4> parts{};
  const auto expect = [&](bool is_right) {
    if (is_right) return;
    table.fail("start", "expected \"time of day\" or a timecode of " + rate +
                            " frames per second as " + (drops ? "10:00:00;00" : "10:00:00:00") +
                            ", found '" + text + "'");
  };
  expect(text.size() == 11 && text[2] == ':' && text[5] == ':' && text[8] == (drops ? ';' : ':'));
  for (size_t i = 0; i < parts.size(); ++i) {
    const char tens = text[3 * i], units = text[3 * i + 1];
    expect(tens >= '0' && tens <= '9' && units >= '0' && units <= '9');
    parts[i] = (tens - '0') * 10 + units - '0';
  }
  const auto [hour, minute, second, frame] = parts;
  expect(hour < 24 && minute < 60 && second < 60 && frame < frames);
  expect(!drops || frame > 1 || second > 0 || minute % 10 == 0);
  return text;
}

StudioSound read_sound(const TomlTable& table, const Studio& studio) {
  StudioSound sound;
  sound.node = read_node(table, studio);
  if (studio.sound_of(sound.node) != nullptr) {
    table.fail("node", "two tables [[sound]] are of node '" + sound.node + "'; expected one");
  }
  if (studio.cameras_of(sound.node).empty() && studio.trigger.node != sound.node) {
    table.fail("node", "'" + sound.node +
                           "' has neither a camera nor the trigger; expected a node "
                           "of v3d-captured");
  }
  sound.device = table.text("device");
  if (sound.device.empty()) {
    table.fail("device", "expected the name of an ALSA device, as arecord -L lists them");
  }
  sound.channels = ranged_int(table, "channels", sound.channels, 1, kMaxChannels);
  sound.rate_hz = read_rate(table, sound.rate_hz);
  sound.pulse_channel = read_channel(table, "pulse_channel", sound.channels);
  sound.timecode_channel = read_channel(table, "timecode_channel", sound.channels);
  if (sound.pulse_channel > 0 && sound.pulse_channel == sound.timecode_channel) {
    table.fail("timecode_channel", "is also the pulse_channel; expected another channel");
  }
  sound.timecode_rate = read_timecode_rate(table);
  table.reject_unknown_fields();
  return sound;
}

StudioTimecodeOutput read_output(const TomlTable& table) {
  StudioTimecodeOutput output;
  output.device = table.text("device");
  if (output.device.empty()) {
    table.fail("device", "expected the name of an ALSA device, as aplay -L lists them");
  }
  output.channels = ranged_int(table, "channels", output.channels, 1, kMaxChannels);
  output.rate_hz = read_rate(table, output.rate_hz);
  output.timecode_rate = read_output_rate(table);
  output.start = read_start(table, output.timecode_rate);
  table.reject_unknown_fields();
  return output;
}

}  // namespace

void read_sounds(const TomlTable& file, Studio& studio) {
  for (const TomlTable& table : file.tables("sound")) {
    studio.sounds.push_back(read_sound(table, studio));
  }
}

void read_timecode_output(const TomlTable& file, Studio& studio) {
  if (file.has("timecode_output"))
    studio.timecode_output = read_output(file.table("timecode_output"));
}

// The action trigger of a studio file.

namespace {

bool is_ipv4(const std::string& text) {
  in_addr address{};
  return inet_pton(AF_INET, text.c_str(), &address) == 1;
}

/// A number of 32 bits, at least `low`.
uint32_t checked(const TomlTable& table, std::string_view field, int64_t value, int64_t low) {
  constexpr int64_t kMax = std::numeric_limits<uint32_t>::max();
  if (value < low || value > kMax) {
    table.fail(field, "expected a whole number from " + std::to_string(low) + " to " +
                          std::to_string(kMax) + ", found " + std::to_string(value));
  }
  return static_cast<uint32_t>(value);
}

}  // namespace

void read_action(const TomlTable& table, StudioTrigger& trigger) {
  static constexpr std::array<std::pair<std::string_view, PtpScale>, 2> kScales = {
      {{"tai", PtpScale::kTai}, {"utc", PtpScale::kUtc}}};
  StudioAction& action = trigger.action;
  ActionKeys& keys = action.keys;
  keys.signal = ranged_int(table, "signal", keys.signal, 0, 15);
  const auto key = [&](std::string_view field, int64_t value, int64_t low) {
    return checked(table, field, value, low);
  };
  keys.device_key = key("device_key", table.integer_or("device_key", keys.device_key), 0);
  keys.group_key = key("group_key", table.integer_or("group_key", keys.group_key), 0);
  keys.group_mask = key("group_mask", table.integer_or("group_mask", keys.group_mask), 1);
  action.broadcast = table.text("broadcast");
  if (!is_ipv4(action.broadcast)) {
    table.fail("broadcast", "'" + action.broadcast +
                                "': expected the IPv4 broadcast address of the network of the "
                                "cameras, like 192.168.5.255");
  }
  action.lead_ms = ranged(table, "lead_ms", action.lead_ms, 0.1, 100);
  action.clock = choice(table, "ptp_scale", "tai", kScales);
}

void assign_action_cameras(const TomlTable& file, Studio& studio) {
  if (studio.trigger.kind != TriggerKind::kAction) return;
  const auto tables = file.tables("camera");
  for (size_t i = 0; i < tables.size(); ++i) {
    StudioCamera& camera = studio.cameras[i];
    if (camera.is_free_running()) continue;
    if (camera.kind == CameraKind::kV4l2) {
      tables[i].fail("trigger_control",
                     "action commands do not reach V4L2 cameras; leave it out, "
                     "so that the camera is free-running");
    }
    if (!is_ipv4(camera.address)) {
      tables[i].fail("address", "'" + camera.address +
                                    "': with an action trigger, expected the IPv4 address of the "
                                    "camera, by which its acknowledgements are counted");
    }
    camera.action = studio.trigger.action.keys;
    studio.trigger.action.cameras.push_back({camera.name, camera.address});
  }
}

}  // namespace v3d
