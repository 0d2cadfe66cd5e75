#include "daemon/control/camera_firmware.h"

#include <vector>

#include "base/core/text.h"

namespace v3d::control {
namespace {

/// Names of cameras by model and firmware.
using Cameras = std::map<std::string, std::map<std::string, std::vector<std::string>>>;

void add_cameras(const wire::HealthMessage& health, Cameras& cameras) {
  const std::string suffix = std::string(".") + kCameraFirmware;
  for (const auto& [text_name, firmware] : health.texts) {
    if (!text_name.ends_with(suffix) || firmware.empty()) continue;
    const std::string camera = text_name.substr(0, text_name.size() - suffix.size());
    const auto model = health.texts.find(camera + "." + kCameraModel);
    if (model != health.texts.end()) cameras[model->second][firmware].push_back(camera);
  }
}

}  // namespace

std::string firmware_differences(const std::map<std::string, wire::HealthMessage>& health) {
  Cameras cameras;
  for (const auto& [node, message] : health) add_cameras(message, cameras);
  std::string text;
  for (const auto& [model, versions] : cameras) {
    if (versions.size() < 2) continue;
    text += (text.empty() ? "" : "; ") + model + ": firmware ";
    std::string separator;
    for (const auto& [firmware, names] : versions) {
      text += separator + firmware + " on " + join_names(names);
      separator = ", ";
    }
  }
  return text;
}

}  // namespace v3d::control
