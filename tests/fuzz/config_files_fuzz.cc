// Fuzz target: studio, calibration, scene and edit files. Any text is read or rejected with an
// InputError.
#include <string_view>

#include "base/config/calib_file.h"
#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "v3dctl/edit/editor.h"
#include "v3dctl/scene/scene_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    v3d::parse_calib(text, "calib.toml");
  } catch (const v3d::InputError&) {
  }
  try {
    v3d::parse_studio(text, "studio.toml");
  } catch (const v3d::InputError&) {
  }
  try {
    const v3d::ctl::Scene scene = v3d::ctl::parse_scene(text, "scene.json");
    v3d::ctl::camera_at(scene.camera, scene.seconds / 2);
    for (const auto& take : scene.takes) v3d::ctl::pulse_at(take, 25, 0, 9, scene.seconds / 2);
  } catch (const v3d::InputError&) {
  }
  try {
    v3d::ctl::parse_edits(text, "edit.json");
  } catch (const v3d::InputError&) {
  }
  return 0;
}
