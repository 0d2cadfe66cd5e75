// [lights] of a studio file.
#include "base/config/studio_fields.h"

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

}  // namespace v3d
