// The action trigger of a studio file.
#include <arpa/inet.h>

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
