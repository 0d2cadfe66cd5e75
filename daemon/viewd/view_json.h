// Messages to the viewer's page: JSON, and binary messages with a JSON header. Confines
// nlohmann::json to one source file. Bytes that are not UTF-8 are replaced.
//
// A binary message is: u32 (little-endian) size of the JSON, the JSON, then data by `type`.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/geometry/camera_model.h"
#include "recon/texture/texture.h"
#include "take/ledger/sound_ledger.h"
#include "wire/messages.h"

namespace v3d::viewd {

/// {"scenes": [names]}
std::string scenes_json(const std::vector<std::string>& names);

/// {"cameras": [{"name", "width", "height", "matrix" (3x3), "distortion", "rotation" (3x3) and
/// "translation" of cam_from_world}]}
std::string rig_json(const Rig& rig);

/// {"performers": [1, 3]}
std::string skeletons_json(const std::vector<int>& performers);

/// {"files": [{"file", "rate_hz", "channels", "samples", "audible" (channels, from 1), "map" (pairs
/// of pulse and sample)}]}: the sound files of a take that have a map of its pulses. `studio`: that
/// of the take.
std::string sound_json(const std::vector<take::SoundLedger>& sounds,
                       const std::optional<Studio>& studio);

/// A compact frame: {"type": "mesh", "number", "take", "pulse", "edge_ms" and "sent_ms" since
/// 1970 (edge_ms null when unknown), "silhouette_iou", "coverage", "cameras", "missing"}, then the
/// compact frame.
std::string mesh_message(const wire::MeshMessage& mesh, int64_t number);

/// {"pulse", "vertices", "cameras": [{"name", "axis" (unit viewing direction, world)}]};
/// then for each camera the visibility of the vertices, two bits each, the first in the lowest bits
/// of its byte (0: not visible, 1: Visibility::kRim, 2: Visibility::kFull), and then red, green and
/// blue of the visible ones. Requires that `rig` has the cameras.
std::string vertex_views_message(int64_t pulse, int64_t vertices,
                                 const std::vector<recon::CameraColours>& views, const Rig& rig);

/// {"type": "preview", "camera", "pulse", "width", "height", "runs"}, then `runs` bytes of
/// mask runs (base/image/mask.h), then a JPEG.
std::string preview_message(const wire::PreviewMessage& preview);

/// {"type": "event", "node", "severity", "subject", "text", "sent_ms"}
std::string event_json(const wire::EventMessage& event);

/// The content of state_json().
struct StudioState {
  std::string studio;
  std::string not_verified;        ///< why messages are not verified; empty: they are
  std::vector<std::string> nodes;  ///< all nodes of the studio
  std::map<std::string, std::vector<std::string>> cameras;  ///< by node
  std::map<std::string, wire::HealthMessage> health;        ///< of nodes that are not silent
  int64_t watchers = 0;                                     ///< connected clients
  bool control = false;                                     ///< browsers may send commands
  RealtimeInstant sent;
};
/// {"type": "state", "studio", "not_verified", "watchers", "control", "sent_ms" since 1970,
/// "nodes":
/// [{"name", "heard", "cameras"; if heard: "program", "version", "state", "take", "text",
/// "values"}]}
std::string state_json(const StudioState& state);

}  // namespace v3d::viewd
