#include "capture/make_camera.h"

#include <cassert>

#include "capture/aravis_camera.h"
#include "capture/v4l2_camera.h"

namespace v3d {

std::unique_ptr<Camera> make_camera(const StudioCamera& settings) {
  switch (settings.kind) {
    case CameraKind::kAravis:
      return std::make_unique<AravisCamera>(settings);
    case CameraKind::kV4l2:
      return std::make_unique<V4l2Camera>(settings);
  }
  assert(false);
  return nullptr;
}

}  // namespace v3d
