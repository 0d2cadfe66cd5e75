// What the operator is told of a node's cameras: figures with every health message, and events when
// something happens.
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
  /// `events` outlives the watch.
  explicit CameraMonitor(EventSender& events) : events_(events) {}

  /// A train begins: frames are counted from 0.
  void begin_train();
  /// Tells of a camera that was lost or came back since the last call; to be called often.
  void look_at(const CameraWorker& worker);
  /// Adds the figures of a camera to the node's, and tells of frames that are missing or suspect,
  /// again as EventThrottle says. `due`: frames that should be here by now.
  void report(const CameraWorker& worker, int64_t due, HealthMessage& health);

 private:
  struct Told {
    int64_t losses = 0;
    bool lost = false;
    EventThrottle suspect;
    EventThrottle missing;
  };

  void tell_missing(const std::string& camera, int64_t missing, int64_t due);
  void tell_suspect(const std::string& camera, const CameraWorkerStatus& status);

  EventSender& events_;
  RateMeter rates_;
  std::map<std::string, Told> told_;  ///< by camera
};

}  // namespace v3d
