#include "daemon/captured/camera_settings_file.h"

#include <spdlog/spdlog.h>

#include "base/config/toml_file.h"
#include "base/io/file.h"

namespace v3d::captured {

std::string camera_settings_text(
    const std::string& node, const std::map<std::string, capture::CameraWorkerStatus>& cameras) {
  TomlWriter file;
  file.comment("The cameras of " + node + ", and settings that differ from the studio file.");
  file.comment("v3d-captured writes this file when it opens a camera.");
  for (const auto& [name, status] : cameras) {
    if (status.size.pixels() == 0) continue;
    file.element("camera").text("name", name).text("device", status.device.text());
  }
  for (const auto& [name, status] : cameras) {
    for (const capture::SettingDifference& difference : status.differences) {
      file.element("difference").text("camera", name).text("setting", difference.setting);
      file.text("asked", difference.asked).text("got", difference.got);
      file.boolean("rounded", difference.rounded);
    }
  }
  return file.written();
}

void CameraSettingsFile::update(const std::string& text) {
  if (text == last_) return;
  last_ = text;
  const io::Status written = io::replace_file(path_, text);
  if (!written) spdlog::warn("{}", written.error().message);
}

}  // namespace v3d::captured
