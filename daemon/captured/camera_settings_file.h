// File about the cameras of a node: models, firmware, and settings that differ from the studio
// file.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "capture/cameras/camera_worker.h"

namespace v3d::captured {

/// TOML: [[camera]] name, device, and [[difference]] camera, setting, asked, got, rounded, for each
/// camera by name. Cameras that were never opened are absent.
std::string camera_settings_text(const std::string& node,
                                 const std::map<std::string, capture::CameraWorkerStatus>& cameras);

/// .camera-settings-NODE.toml in the folder of takes. One thread.
class CameraSettingsFile {
 public:
  explicit CameraSettingsFile(std::filesystem::path path) : path_(std::move(path)) {}

  /// Replaces the file when its content would differ from that of the last call. An error is
  /// logged; the next call with another content tries again.
  void update(const std::string& text);

 private:
  const std::filesystem::path path_;
  std::string last_;
};

}  // namespace v3d::captured
