#include "daemon/viewd/dropped_meshes.h"

#include "base/core/text.h"

namespace v3d::viewd {

std::optional<std::string> DroppedMeshes::line(const LiveFeedCounts& counts, MonotonicInstant now) {
  if (!unusable_.is_report_due(counts.unusable, now)) return {};
  return "browsers did not get " + format_count(counts.unusable) + " of " +
         format_count(counts.frames) +
         " live meshes: they are damaged, or a mesh that they refer to is missing. Check the "
         "network of this PC and its receive buffer (v3dctl doctor)";
}

std::optional<std::string> DroppedMeshes::line_of_relay(int64_t dropped, MonotonicInstant now) {
  if (!waiting_.is_report_due(dropped, now)) return {};
  return "browsers did not get " + format_count(dropped) +
         " live meshes, which waited too long in this PC. Check the load of its processor";
}

}  // namespace v3d::viewd
