#include "capture/make_camera.h"

#include "base/error.h"
#include "capture/aravis_camera.h"

namespace v3d {

std::unique_ptr<Camera> make_camera(const StudioCamera& settings) {
  switch (settings.kind) {
    case CameraKind::kAravis:
      return std::make_unique<AravisCamera>(settings);
    case CameraKind::kV4l2:
      break;
  }
  throw InputError("camera " + settings.name +
                   ": kind v4l2 is not in this build; right would be aravis");
}

}  // namespace v3d
