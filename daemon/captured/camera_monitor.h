// Camera health: numbers of each camera for health messages, and events about lost cameras and
// missing or suspect frames.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "capture/cameras/camera_worker.h"
#include "daemon/bus/event_sender.h"
#include "daemon/bus/event_throttle.h"
#include "daemon/node/rate_meter.h"
#include "wire/messages.h"

namespace v3d {

/// One thread.
class CameraMonitor {
 public:
  /// `events` outlives the monitor.
  explicit CameraMonitor(EventSender& events) : events_(events) {}

  /// Call when a train starts: frames are counted from 0.
  void reset();
  /// Sends an event when the camera was lost or came back since the last call. Call it often.
  void update(const CameraWorker& worker);
  /// Adds the camera's numbers to `health`. Sends events about missing and suspect frames, as often
  /// as EventThrottle allows. `due`: frames that should have arrived by now.
  void report(const CameraWorker& worker, int64_t due, HealthMessage& health);

 private:
  /// What was reported about one camera.
  struct Reported {
    int64_t losses = 0;
    bool lost = false;
    EventThrottle suspect;
    EventThrottle missing;
  };

  void report_missing(const std::string& camera, int64_t missing, int64_t due);
  void report_suspect(const std::string& camera, const CameraWorkerStatus& status);

  EventSender& events_;
  RateMeter rates_;
  std::map<std::string, Reported> reported_;  ///< by camera
};

}  // namespace v3d
