#include "capture/cameras/make_camera.h"

#include <utility>

#include "capture/cameras/aravis_camera.h"
#include "capture/cameras/free_running_camera.h"
#include "capture/cameras/v4l2_camera.h"

namespace v3d {

std::unique_ptr<Camera> make_camera(const StudioCamera& settings, const PulseTimes& pulses) {
  if (settings.kind == CameraKind::kAravis) return std::make_unique<AravisCamera>(settings);
  auto camera = std::make_unique<V4l2Camera>(settings);
  if (!settings.is_free_running()) return camera;
  V4l2Camera& borrowed = *camera;
  return std::make_unique<FreeRunningCamera>(
      std::move(camera), [&borrowed](double rate_hz) { borrowed.run_free(rate_hz); }, pulses);
}

}  // namespace v3d
