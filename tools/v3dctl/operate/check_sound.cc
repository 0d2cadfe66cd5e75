#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "v3dctl/operate/camera_report.h"

namespace v3d::ctl {

using Json = nlohmann::ordered_json;

std::optional<NodeSoundCheck> parse_sound(const Json& detail, const std::string& node) {
  const Json sound = detail.value("sound", Json());
  if (sound.is_null()) return std::nullopt;
  NodeSoundCheck check{.node = node, .fault = sound.at("fault").get<std::string>(), .clap = {}};
  const Json& pulse = sound.at("clap_pulse");
  if (pulse.is_null()) return check;
  check.clap = {.sound_pulse = pulse.get<double>(),
                .sound_uncertainty_s = 1e-6 * sound.at("uncertainty_us").get<double>(),
                .rate_hz = detail.at("pulses").at("rate_hz").get<double>()};
  return check;
}

void compare_with_pictures(const CameraStops& stops, std::vector<NodeSoundCheck>& sounds) {
  for (NodeSoundCheck& sound : sounds) {
    if (!sound.clap) continue;
    for (const auto& [camera, of_camera] : stops) {
      const auto stop =
          segmentation::stop_near(of_camera, sound.clap->sound_pulse, sound.clap->rate_hz);
      if (stop) sound.clap->cameras.push_back({camera, stop->pulse});
    }
  }
}

std::vector<std::string> sound_lines(const std::vector<NodeSoundCheck>& sounds) {
  std::vector<std::string> lines;
  for (const NodeSoundCheck& sound : sounds) {
    std::string line = "sound of " + sound.node + ": ";
    if (!sound.clap) {
      lines.push_back(line + (sound.fault.empty() ? "no clap found" : sound.fault));
      continue;
    }
    line += clap_text(*sound.clap);
    const char* separator = " (";
    for (const ClapOffset::Camera& camera : sound.clap->cameras) {
      line += separator + fmt::format("{} {:+.0f} ms", camera.name,
                                      1000 * sound.clap->later_than(camera.pulse));
      separator = ", ";
    }
    lines.push_back(line + (sound.clap->cameras.empty() ? "" : ")"));
  }
  return lines;
}

Json sounds_json(const std::vector<NodeSoundCheck>& sounds) {
  Json all = Json::array();
  for (const NodeSoundCheck& sound : sounds) {
    Json json = {{"node", sound.node}, {"fault", sound.fault}};
    json.update(clap_json(sound.clap));
    Json cameras = Json::array();
    if (sound.clap) {
      for (const ClapOffset::Camera& camera : sound.clap->cameras) {
        cameras.push_back(
            {{"name", camera.name}, {"offset_ms", 1000 * sound.clap->later_than(camera.pulse)}});
      }
    }
    json["cameras"] = std::move(cameras);
    all.push_back(std::move(json));
  }
  return all;
}

}  // namespace v3d::ctl
