// What the viewer's page is told, as JSON, and the frame round what is no JSON. The adapter of
// nlohmann::json. Texts that are no UTF-8 are mended, never refused.
//
// A binary message is: u32 (little-endian) length of the JSON, the JSON, then what `type` says.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "base/studio_file.h"
#include "recon/texture/camera_colours.h"
#include "wire/messages.h"

namespace v3d {

/// {"scenes": [names]}
std::string scenes_json(const std::vector<std::string>& names);

/// {"cameras": [{"name", "width", "height", "matrix" (3x3), "distortion", "rotation" (3x3) and
/// "translation" of cam_from_world}]}
std::string rig_json(const Rig& rig);

/// Of one compact frame: {"type": "mesh", "number", "take", "pulse", "edge_ms" and "sent_ms" since
/// 1970 (edge_ms null when unknown), "silhouette_iou", "coverage", "cameras", "missing"}, then the
/// compact frame.
std::string mesh_message(const MeshMessage& mesh, int64_t number);

/// {"pulse", "vertices", "cameras": [{"name", "axis" (unit vector of where it looks, world)}]};
/// then of each camera how it sees the vertices, two bits each, the first lowest in its byte (0:
/// not, 1: Visibility::kRim, 2: Visibility::kFull), and then red, green and blue of those that it
/// sees. Requires that `rig` has the cameras.
std::string vertex_views_message(int64_t pulse, int64_t vertices,
                                 const std::vector<CameraColours>& views, const Rig& rig);

/// {"type": "preview", "camera", "pulse", "width", "height", "runs"}, then so many bytes of the
/// mask's runs (base/mask.h), then a JPEG.
std::string preview_message(const PreviewMessage& preview);

/// {"type": "event", "node", "severity", "subject", "text", "sent_ms"}
std::string event_json(const EventMessage& event);

/// What the studio's state is made of.
struct StudioState {
  std::string studio;
  std::string not_verified;        ///< why what is shown may be anybody's; else empty
  std::vector<std::string> nodes;  ///< that should be heard
  std::map<std::string, std::vector<std::string>> cameras;  ///< of a node
  std::map<std::string, HealthMessage> health;              ///< of those that are heard
  int64_t watchers = 0;                                     ///< browsers that are connected
  bool control = false;                                     ///< orders are taken
};
/// {"type": "state", "studio", "not_verified", "watchers", "control", "nodes": [{"name", "heard",
/// "cameras"; if heard: "program", "version", "state", "take", "text", "values"}]}
std::string state_json(const StudioState& state);

/// {"type": "pong", "ping", "now_ms"}: for the page's clock.
std::string pong_json(int64_t ping, RealtimeInstant now);

}  // namespace v3d
