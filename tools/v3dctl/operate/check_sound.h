// Claps detected by `v3dctl check`, and their offset from the pictures.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "capture/segmentation/motion_stops.h"
#include "v3dctl/takes/clap.h"

namespace v3d::ctl {

/// The ends of motions in the pictures of each camera, by its name.
using CameraStops = std::map<std::string, std::vector<segmentation::MotionStop>>;

/// Result of the clap detection of one node, from "sound" in the detail of its reply.
struct NodeSoundCheck {
  std::string node;
  std::string fault;               ///< why it could detect no clap; empty: none
  std::optional<ClapOffset> clap;  ///< empty: no clap
};

/// Empty for a node without sound input. The clap has no cameras yet. Throws a Json exception when
/// the detail is no result of a check.
std::optional<NodeSoundCheck> parse_sound(const nlohmann::ordered_json& detail,
                                          const std::string& node);

/// Adds the cameras of all nodes whose motion stops within half a second of a clap.
void compare_with_pictures(const CameraStops& stops, std::vector<NodeSoundCheck>& sounds);

/// One line for each node with sound input.
std::vector<std::string> sound_lines(const std::vector<NodeSoundCheck>& sounds);
/// [{node, fault, sound_pulse, picture_pulse, cameras [{name, offset_ms}], offset_ms,
/// uncertainty_ms}]
nlohmann::ordered_json sounds_json(const std::vector<NodeSoundCheck>& sounds);

}  // namespace v3d::ctl
