#include "daemon/viewd/view_json.h"

#include <nlohmann/json.hpp>

#include "base/image/mask.h"
#include "take/take_sound.h"

namespace v3d::viewd {
namespace {

using Json = nlohmann::json;

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

double milliseconds(RealtimeInstant t) { return static_cast<double>(to_ns(t)) * 1e-6; }

Json matrix_json(const Eigen::Matrix3d& m) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back({m(row, 0), m(row, 1), m(row, 2)});
  return rows;
}

Json camera_json(const RigCamera& camera) {
  const CameraModel& model = camera.model;
  const Eigen::Vector3d& t = model.cam_from_world().translation;
  return {{"name", camera.name},
          {"width", model.size().width},
          {"height", model.size().height},
          {"matrix", matrix_json(model.matrix())},
          {"distortion", model.distortion()},
          {"rotation", matrix_json(model.cam_from_world().rotation)},
          {"translation", {t.x(), t.y(), t.z()}}};
}

std::string framed(const Json& head) {
  const std::string text = text_of(head);
  std::string message;
  for (int byte = 0; byte < 4; ++byte) {
    message += static_cast<char>(text.size() >> (8 * byte) & 0xff);
  }
  return message + text;
}

void append(std::string& message, const std::vector<uint8_t>& bytes) {
  message.append(bytes.begin(), bytes.end());
}

void append(std::string& message, const recon::CameraColours& view) {
  const size_t visibility_begin = message.size();
  message.resize(visibility_begin + (view.vertices.size() + 3) / 4);
  for (size_t v = 0; v < view.vertices.size(); ++v) {
    const auto& [r, g, b, seen] = view.vertices[v];
    const auto visibility = static_cast<recon::Visibility>(seen);
    if (visibility == recon::Visibility::kNone) continue;
    const unsigned bits = visibility == recon::Visibility::kFull ? 2 : 1;
    message[visibility_begin + v / 4] |= static_cast<char>(bits << (2 * (v % 4)));
    message += {static_cast<char>(r), static_cast<char>(g), static_cast<char>(b)};
  }
}

std::string_view name_of(wire::Severity severity) {
  switch (severity) {
    case wire::Severity::kInfo:
      return "info";
    case wire::Severity::kWarning:
      return "warning";
    case wire::Severity::kAlarm:
      return "alarm";
  }
  return "";
}

Json node_json(const StudioState& state, const std::string& node) {
  const auto cameras = state.cameras.find(node);
  const auto found = state.health.find(node);
  Json json = {{"name", node}, {"heard", found != state.health.end()}};
  json["cameras"] = cameras == state.cameras.end() ? Json::array() : Json(cameras->second);
  if (found == state.health.end()) return json;
  const wire::HealthMessage& health = found->second;
  json["program"] = health.program;
  json["version"] = health.version;
  json["state"] = name(health.state);
  json["take"] = health.take;
  json["text"] = health.text;
  json["values"] = health.values;
  json["texts"] = health.texts;
  return json;
}

}  // namespace

std::string scenes_json(const std::vector<std::string>& names) {
  return text_of({{"scenes", names}});
}

std::string skeletons_json(const std::vector<int>& performers) {
  return text_of({{"performers", performers}});
}

std::string rig_json(const Rig& rig) {
  Json cameras = Json::array();
  for (const RigCamera& camera : rig) cameras.push_back(camera_json(camera));
  return text_of({{"cameras", cameras}});
}

std::string sound_json(const std::vector<take::SoundLedger>& sounds,
                       const std::optional<Studio>& studio) {
  Json files = Json::array();
  for (const take::SoundLedger& sound : sounds) {
    if (!sound.map.is_known()) continue;
    Json map = Json::array();
    for (const auto& knot : sound.map.knots) map.push_back({knot.pulse, knot.sample});
    files.push_back({{"file", sound.file},
                     {"rate_hz", sound.rate_hz},
                     {"channels", sound.channels},
                     {"samples", sound.samples},
                     {"audible", take::audible_channels(sound, studio)},
                     {"map", std::move(map)}});
  }
  return text_of({{"files", std::move(files)}});
}

std::string mesh_message(const wire::MeshMessage& mesh, int64_t number) {
  const bool timed = to_ns(mesh.pulse_edge) != 0;
  std::string message = framed({{"type", "mesh"},
                                {"number", number},
                                {"take", mesh.take},
                                {"pulse", mesh.pulse},
                                {"edge_ms", timed ? Json(milliseconds(mesh.pulse_edge)) : Json()},
                                {"sent_ms", milliseconds(mesh.sent)},
                                {"silhouette_iou", mesh.silhouette_iou},
                                {"coverage", mesh.coverage},
                                {"cameras", mesh.cameras},
                                {"missing", mesh.missing}});
  append(message, mesh.compact);
  return message;
}

std::string vertex_views_message(int64_t pulse, int64_t vertices,
                                 const std::vector<recon::CameraColours>& views, const Rig& rig) {
  Json cameras = Json::array();
  for (const recon::CameraColours& view : views) {
    const auto index = static_cast<size_t>(find_camera(rig, view.camera));
    const Eigen::Vector3d axis = rig[index].model.viewing_direction();
    cameras.push_back({{"name", view.camera}, {"axis", {axis.x(), axis.y(), axis.z()}}});
  }
  std::string message = framed({{"pulse", pulse}, {"vertices", vertices}, {"cameras", cameras}});
  for (const recon::CameraColours& view : views) append(message, view);
  return message;
}

std::string preview_message(const wire::PreviewMessage& preview) {
  const std::vector<uint8_t> runs =
      preview.mask ? encode_runs(*preview.mask) : std::vector<uint8_t>();
  std::string message = framed({{"type", "preview"},
                                {"camera", preview.camera},
                                {"pulse", preview.pulse},
                                {"width", preview.size.width},
                                {"height", preview.size.height},
                                {"runs", runs.size()}});
  append(message, runs);
  append(message, preview.jpeg);
  return message;
}

std::string event_json(const wire::EventMessage& event) {
  return text_of({{"type", "event"},
                  {"node", event.node},
                  {"severity", name_of(event.severity)},
                  {"subject", event.subject},
                  {"text", event.text},
                  {"sent_ms", milliseconds(event.sent)}});
}

std::string state_json(const StudioState& state) {
  Json nodes = Json::array();
  for (const std::string& node : state.nodes) nodes.push_back(node_json(state, node));
  return text_of({{"type", "state"},
                  {"studio", state.studio},
                  {"not_verified", state.not_verified},
                  {"watchers", state.watchers},
                  {"control", state.control},
                  {"sent_ms", milliseconds(state.sent)},
                  {"nodes", nodes}});
}

}  // namespace v3d::viewd
