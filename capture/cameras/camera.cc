#include "capture/cameras/camera.h"

namespace v3d {

CameraStatistics operator+(const CameraStatistics& a, const CameraStatistics& b) {
  CameraStatistics sum = b;
  sum.completed += a.completed;
  sum.damaged += a.damaged;
  sum.underruns += a.underruns;
  sum.packets_resent += a.packets_resent;
  sum.packets_missing += a.packets_missing;
  return sum;
}

}  // namespace v3d
