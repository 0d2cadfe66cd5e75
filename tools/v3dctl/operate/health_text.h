// Text and JSON of the nodes' health messages. Pure.
//
// In every function `health` has the last message of each node; a node without an entry is silent.
// Results are in the order of `nodes`.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::ctl {

using Json = nlohmann::ordered_json;

/// Temperatures above these need the operator's attention, as in tools/monitoring/v3d.rules.yml.
inline constexpr double kMaxPcCelsius = 85;
inline constexpr double kMaxCameraCelsius = 75;

/// Value of a counter or gauge with the unit in the end of its name: "812 GB" for disk_free_bytes,
/// "45 min" for disk_seconds_left, "yes" for streaming_flag, "+12 us", "25.0/s"; otherwise a count.
std::string value_text(const std::string& name, double value);

/// Duration with one unit, rounded: 45 s, 12 min, 3.5 h, 2 d.
std::string duration_text(double seconds);

/// The next step for a silent node: "Try: systemctl status --all 'v3d-*' on cap01". The status of
/// v3d-studio.target would not list the daemons that have ended.
std::string silent_node_advice(const std::string& node);

/// "recording kendo-07"; "check: nothing is recorded" while it runs; "idle".
std::string doing_text(const wire::HealthMessage& health);

/// Whether the values of a node tell if its clock is synchronised, by chronyd, systemd-timesyncd or
/// ptp4l. The alert V3dClockUnknown has the same condition.
bool has_clock_state(const wire::HealthMessage& health);
/// What users read about a node without has_clock_state().
inline constexpr char kNoClockState[] =
    "neither chronyd, systemd-timesyncd nor ptp4l reports that the clock is synchronised";

/// One line for each node: "cap01  v3d-captured  recording kendo-07  cam07 silent".
std::vector<std::string> status_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, wire::HealthMessage>& health);

/// status_lines(), with all values of each node below its line and a table of its cameras.
std::vector<std::string> health_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, wire::HealthMessage>& health);

/// {"well", "nodes" [{"node", "program", "version", "state", "take", "text", "texts", "values"}]}
Json health_json(const std::vector<std::string>& nodes,
                 const std::map<std::string, wire::HealthMessage>& health);

/// Whether every node has reported, none has a fault, and none is absent_nodes().
bool all_well(const std::vector<std::string>& nodes,
              const std::map<std::string, wire::HealthMessage>& health);

/// Whether every node has reported.
bool all_reported(const std::vector<std::string>& nodes,
                  const std::map<std::string, wire::HealthMessage>& health);

/// Whether the node records a take or drains the frames in flight after its end.
bool is_in_take(const wire::HealthMessage& health);

/// The nodes with cameras that do not record the take which another node records, for example after
/// a restart. Sorted by name.
std::vector<std::string> absent_nodes(const std::map<std::string, wire::HealthMessage>& health);

/// Sum of a value over the nodes; empty when none reports it.
std::optional<double> sum_over_nodes(const std::map<std::string, wire::HealthMessage>& health,
                                     const std::string& name);

/// Progress of the running take: "300 pulses   15/15 cameras   0 missing   live 25.0/s, 71 ms".
/// Values that no node reports are left out. Cameras of absent_nodes() do not count as streaming,
/// and these nodes follow: "cap02 does not record".
std::string recording_line(const std::map<std::string, wire::HealthMessage>& health);

}  // namespace v3d::ctl
