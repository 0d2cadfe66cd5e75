// Checks of every node of the studio, from the health that it sends.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "daemon/control/camera_firmware.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;
using Health = std::map<std::string, wire::HealthMessage>;

/// Limit of one health value. The alerts of tools/monitoring have the same limits.
struct ValueCheck {
  const char* value;
  const char* subject;
  bool (*is_bad)(double);
  const char* remedy;
};

constexpr ValueCheck kValueChecks[] = {
    {"disk_free_bytes", "disk space", [](double v) { return v < 50e9; },
     "v3dctl takes collect, then v3dctl takes delete"},
    {"disk_full_flag", "disk of the last take", [](double v) { return v != 0; },
     "v3dctl takes collect, then v3dctl takes delete"},
    {"disk_smart_failed_flag", "disk health", [](double v) { return v != 0; },
     "collect the takes, and replace the disk"},
    {"disk_wear_percent", "disk wear", [](double v) { return v >= 90; }, "order a new disk"},
    {"temperature_max_celsius", "temperature", [](double v) { return v > kMaxPcCelsius; },
     "check its fans and filters"},
    {"memory_available_bytes", "memory", [](double v) { return v < 500e6; },
     "v3dctl health shows what the daemon uses"},
    {"clock_synchronised_flag", "clock", [](double v) { return v == 0; }, "chronyc sources there"},
    {"clock_offset_us", "clock offset", [](double v) { return std::abs(v) > 1000; },
     "before the next take, wait until chronyd has corrected it, or as root there: chronyc "
     "makestep"},
    {"slot_trial_flag", "update", [](double v) { return v != 0; },
     "wait for the end of its trial; systemctl status v3d-slot-check there"},
};

constexpr ValueCheck kPtpCheck = {"ptp_offset_us", "clock offset",
                                  [](double v) { return std::abs(v) > 1000; },
                                  "journalctl -u ptp4l there: check that it receives its master"};

void add_value(const ValueCheck& check, const wire::HealthMessage& health,
               std::vector<Finding>& findings) {
  const auto value = health.values.find(check.value);
  if (value == health.values.end()) return;
  const bool is_bad = check.is_bad(value->second);
  findings.push_back({is_bad ? Verdict::kBad : Verdict::kGood, health.node + " " + check.subject,
                      std::string(check.value) + " is " + value_text(check.value, value->second),
                      is_bad ? check.remedy : ""});
}

/// Whether ptp4l alone synchronises the clock. Beside chronyd or systemd-timesyncd it may only
/// serve the cameras, or observe.
bool has_ptp_clock(const wire::HealthMessage& health) {
  return health.values.contains("ptp_steps_removed") &&
         !health.values.contains("clock_synchronised_flag");
}

void add_values(const wire::HealthMessage& health, std::vector<Finding>& findings) {
  for (const ValueCheck& check : kValueChecks) add_value(check, health, findings);
  if (has_ptp_clock(health)) add_value(kPtpCheck, health, findings);
}

/// A ptp4l that has lost its master becomes one: then there are two, and their clocks drift apart.
/// PCs with chronyd may each be the master of their own cameras. The alert V3dPtpMasters has the
/// same condition.
std::optional<Finding> check_ptp_masters(const Health& health) {
  std::string masters;
  int count = 0;
  bool has_lost_one = false;
  for (const auto& [node, message] : health) {
    const auto steps = message.values.find("ptp_steps_removed");
    if (steps == message.values.end() || steps->second != 0) continue;
    masters += (count++ > 0 ? " and " : "") + node;
    has_lost_one |= has_ptp_clock(message);
  }
  if (count < 2 || !has_lost_one) return std::nullopt;
  return Finding{Verdict::kBad, "clock",
                 masters + " are all PTP masters, so their clocks drift apart",
                 "check the network between them; journalctl -u ptp4l there"};
}

/// v3dctl doctor on the node can say more: it also asks the kernel, which the sandbox of the
/// daemons does not allow.
void add_unknown_clock(const wire::HealthMessage& health, std::vector<Finding>& findings) {
  if (has_clock_state(health)) return;
  findings.push_back({Verdict::kUnknown, health.node + " clock", kNoClockState,
                      "v3dctl doctor " + health.node + " there"});
}

/// Reports an appliance that cannot read V3D-BOOT: its health has no slot_trial_flag. The alert
/// V3dSlotsUnreadable has the same condition.
std::optional<Finding> check_slots(const wire::HealthMessage& health) {
  const auto& values = health.values;
  if (!values.contains("slot_number") || values.contains("slot_trial_flag")) return std::nullopt;
  return Finding{Verdict::kBad, health.node + " update",
                 "the partition V3D-BOOT cannot be read, so the system is not confirmed",
                 "systemctl status v3d-slot-check v3d-health there"};
}

Finding check_cameras_of(const wire::HealthMessage& health, double cameras) {
  const auto streaming = health.values.find("cameras_streaming");
  const double count = streaming == health.values.end() ? 0 : streaming->second;
  const std::string text = fmt::format("{:.0f} of {:.0f} cameras send frames", count, cameras);
  if (count >= cameras) return {Verdict::kGood, health.node + " cameras", text, ""};
  return {Verdict::kBad, health.node + " cameras", text, "v3dctl doctor " + health.node + " there"};
}

/// The text of a health message is a problem, also without a fault: "no take can be armed".
Finding check_state(const wire::HealthMessage& health) {
  const std::string text = health.program + " " + health.version +
                           (health.text.empty() ? ", no problem" : ": " + health.text);
  const bool is_bad = health.state == wire::NodeState::kFault || !health.text.empty();
  return {is_bad ? Verdict::kBad : Verdict::kGood, health.node, text,
          is_bad ? "journalctl -u 'v3d-*' there" : ""};
}

/// All nodes need the same program, and the appliances the same system: the version of an appliance
/// is "1.4.0+SYSTEM". The alert V3dVersionsDiffer compares the same. Empty where no node has sent
/// health.
std::optional<Finding> check_versions(const std::vector<std::string>& nodes, const Health& health) {
  if (health.empty()) return std::nullopt;
  std::set<std::string> versions, programs, systems;
  std::string text;
  for (const auto& [node, message] : health) {
    const size_t plus = message.version.find('+');
    programs.insert(message.version.substr(0, plus));
    if (plus != std::string::npos) systems.insert(message.version);
    if (!versions.insert(message.version).second) continue;
    text += (text.empty() ? "" : ", ") + node + " has " + message.version;
  }
  if (programs.size() <= 1 && systems.size() <= 1) {
    const bool all =
        std::ranges::all_of(nodes, [&](const auto& node) { return health.contains(node); });
    return Finding{Verdict::kGood, "versions",
                   all ? "all nodes have the same" : "the nodes that reply have the same", ""};
  }
  return Finding{Verdict::kBad, "versions", text,
                 "v3dctl update BUNDLE --all; on PCs that are no appliance, apt"};
}

/// Cameras above the limit of the alert V3dCameraHot.
void add_hot_cameras(const wire::HealthMessage& health, std::vector<Finding>& findings) {
  constexpr std::string_view kSuffix = ".temperature_celsius";
  for (const auto& [name, value] : health.values) {
    if (!name.ends_with(kSuffix) || value <= kMaxCameraCelsius) continue;
    findings.push_back({Verdict::kBad, name.substr(0, name.size() - kSuffix.size()),
                        "the camera has " + value_text(name, value),
                        "give it air, or mount it on metal"});
  }
}

/// Empty where no camera reports its firmware.
std::optional<Finding> check_firmware(const Health& health) {
  const bool has_any = std::ranges::any_of(health, [](const auto& of_node) {
    return std::ranges::any_of(of_node.second.texts, [](const auto& text) {
      return text.first.ends_with(std::string(".") + control::kCameraFirmware);
    });
  });
  if (!has_any) return std::nullopt;
  const std::string differences = control::firmware_differences(health);
  if (differences.empty()) {
    return Finding{Verdict::kGood, "firmware", "all cameras of a model have the same", ""};
  }
  return Finding{Verdict::kBad, "firmware", differences,
                 "update the cameras with their maker's program"};
}

}  // namespace

std::vector<Finding> check_nodes(const std::vector<std::string>& nodes, const Health& health) {
  std::vector<Finding> findings;
  for (const std::string& node : nodes) {
    const auto message = health.find(node);
    if (message == health.end()) {
      findings.push_back({Verdict::kBad, node, "no health message received",
                          "check that the PC is on and connected"});
      continue;
    }
    findings.push_back(check_state(message->second));
    const auto cameras = message->second.values.find("cameras");
    if (cameras != message->second.values.end()) {
      findings.push_back(check_cameras_of(message->second, cameras->second));
    }
    add_values(message->second, findings);
    add_unknown_clock(message->second, findings);
    if (const auto slots = check_slots(message->second)) findings.push_back(*slots);
    add_hot_cameras(message->second, findings);
  }
  if (const auto masters = check_ptp_masters(health)) findings.push_back(*masters);
  if (const auto firmware = check_firmware(health)) findings.push_back(*firmware);
  if (const auto versions = check_versions(nodes, health)) findings.push_back(*versions);
  return findings;
}

}  // namespace v3d::ctl
