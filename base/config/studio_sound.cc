// [[sound]] of a studio file.
#include <algorithm>
#include <array>

#include "base/config/studio_fields.h"

namespace v3d {
namespace {

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

/// The name of a rate of timecode, or empty.
std::string read_timecode_rate(const TomlTable& table) {
  // The names of sound/timecode.h, which tests compare.
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kRates = {
      {{"auto", ""},
       {"24", "24"},
       {"25", "25"},
       {"29.97", "29.97"},
       {"29.97df", "29.97df"},
       {"30", "30"}}};
  return std::string(choice(table, "timecode_rate", "auto", kRates));
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
  constexpr int kMaxChannels = 64;
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

}  // namespace

void read_sounds(const TomlTable& file, Studio& studio) {
  for (const TomlTable& table : file.tables("sound")) {
    studio.sounds.push_back(read_sound(table, studio));
  }
}

}  // namespace v3d
