#include "daemon/captured/camera_monitor.h"

#include <algorithm>

#include "base/units.h"
#include "daemon/node/advice.h"

namespace v3d {

void CameraMonitor::begin_train() {
  for (auto& [camera, told] : told_) told.suspect = told.missing = {};
}

void CameraMonitor::look_at(const CameraWorker& worker) {
  const CameraWorkerStatus status = worker.status();
  Told& told = told_[worker.camera()];
  if (status.losses > told.losses) {
    events_.send(Severity::kAlarm, worker.camera(), "lost: " + status.last_loss,
                 advice::kCameraLost);
    told.lost = true;
  }
  told.losses = status.losses;
  const bool back = status.state == CameraState::kIdle || status.state == CameraState::kReady ||
                    status.state == CameraState::kRunning;
  if (!told.lost || !back) return;
  told.lost = false;
  const bool recorded = status.state == CameraState::kRunning;
  events_.send(Severity::kInfo, worker.camera(),
               recorded ? "back, at pulse " + std::to_string(status.last_pulse) : "answers again");
}

namespace {

/// What cameras tell of their last frame, where they do.
void report_last_frame(const std::string& camera, const CameraStatistics& link,
                       HealthMessage& health) {
  if (link.phase) health.values[camera + ".phase_us"] = 1e6 * to_seconds(*link.phase);
  if (link.ptp_offset) {
    health.values[camera + ".ptp_offset_us"] = 1e6 * to_seconds(*link.ptp_offset);
  }
  if (link.exposure_us) health.values[camera + ".exposure_us"] = *link.exposure_us;
}

}  // namespace

void CameraMonitor::report(const CameraWorker& worker, int64_t due, HealthMessage& health) {
  const CameraWorkerStatus status = worker.status();
  const std::string& camera = worker.camera();
  const int64_t missing = std::max<int64_t>(0, due - status.frames);
  const auto value = [&](const std::string& what, int64_t n) {
    health.values[camera + "." + what] = static_cast<double>(n);
  };
  value("frames", status.frames);
  value("frames_missing", missing);
  value("frames_suspect", status.suspect);
  value("frames_dropped", status.dropped);
  value("frames_damaged", status.link.damaged);
  value("underruns", status.link.underruns);
  value("packets_resent", status.link.packets_resent);
  value("packets_missing", status.link.packets_missing);
  value("losses", status.losses);
  report_last_frame(camera, status.link, health);
  health.values["frames_missing"] += static_cast<double>(missing);
  health.values["frames_suspect"] += static_cast<double>(status.suspect);
  const bool streaming =
      status.state != CameraState::kOpening && status.state != CameraState::kLost;
  health.values["cameras_streaming"] += streaming ? 1 : 0;
  value("streaming_flag", streaming ? 1 : 0);
  value("queue_frames", worker.waiting());
  health.values["queue_frames"] =
      std::max(health.values["queue_frames"], static_cast<double>(worker.waiting()));
  health.values[camera + ".frames_per_second"] =
      rates_.rate(camera, status.frames, Monotonic::now());
  tell_missing(camera, missing, due);
  tell_suspect(camera, status);
}

void CameraMonitor::tell_missing(const std::string& camera, int64_t missing, int64_t due) {
  if (missing == 0 || !told_[camera].missing.is_news(missing, Monotonic::now())) return;
  events_.send(Severity::kWarning, camera,
               format_count(missing) + " frames missing of " + format_count(due) + " pulses",
               advice::kFramesMissing);
}

void CameraMonitor::tell_suspect(const std::string& camera, const CameraWorkerStatus& status) {
  const bool is_news =
      status.suspect > 0 && told_[camera].suspect.is_news(status.suspect, Monotonic::now());
  if (!is_news) return;
  events_.send(Severity::kWarning, camera,
               format_count(status.suspect) +
                   " frames with a suspect pulse number, the last near " +
                   std::to_string(status.last_pulse),
               advice::kFramesSuspect);
}

}  // namespace v3d
