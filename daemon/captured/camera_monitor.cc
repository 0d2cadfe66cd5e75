#include "daemon/captured/camera_monitor.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/config/toml_file.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "daemon/control/camera_firmware.h"
#include "daemon/node/advice.h"

namespace v3d::captured {

void CameraMonitor::reset() {
  for (auto& [camera, reported] : reported_) reported.suspect = reported.missing = {};
}

void CameraMonitor::update(const capture::CameraWorker& worker) {
  const capture::CameraWorkerStatus status = worker.status();
  Reported& reported = reported_[worker.camera()];
  if (status.losses > reported.losses) {
    events_.send(wire::Severity::kAlarm, worker.camera(), "lost: " + status.last_loss,
                 node::advice::kCameraLost);
    reported.lost = true;
  }
  reported.losses = status.losses;
  const bool back = status.state == capture::CameraState::kIdle ||
                    status.state == capture::CameraState::kReady ||
                    status.state == capture::CameraState::kRunning;
  if (!reported.lost || !back) return;
  reported.lost = false;
  const bool recorded = status.state == capture::CameraState::kRunning;
  events_.send(wire::Severity::kInfo, worker.camera(),
               recorded ? "recording again, at pulse " + std::to_string(status.last_pulse)
                        : "connected again");
}

namespace {

/// Values of the last frame, for cameras that report them.
void report_last_frame(const std::string& camera, const capture::CameraStatistics& link,
                       wire::HealthMessage& health) {
  if (link.phase) health.values[camera + ".phase_us"] = 1e6 * to_seconds(*link.phase);
  if (link.ptp_offset) {
    health.values[camera + ".ptp_offset_us"] = 1e6 * to_seconds(*link.ptp_offset);
  }
  if (link.temperature_celsius) {
    health.values[camera + ".temperature_celsius"] = *link.temperature_celsius;
  }
  if (link.exposure_us) health.values[camera + ".exposure_us"] = *link.exposure_us;
}

/// Model and firmware, for cameras that report them.
void report_device(const std::string& camera, const capture::CameraDevice& device,
                   wire::HealthMessage& health) {
  const auto text = [&](const char* name, const std::string& value) {
    if (!value.empty()) health.texts[camera + "." + name] = value;
  };
  text(control::kCameraModel, device.model);
  text(control::kCameraFirmware, device.firmware);
}

/// Counters of one camera.
void report_counters(const std::string& camera, const capture::CameraWorkerStatus& status,
                     wire::HealthMessage& health) {
  const auto value = [&](const char* name, int64_t n) {
    health.values[camera + "." + name] = static_cast<double>(n);
  };
  value("frames", status.frames);
  value("frames_suspect", status.suspect);
  value("frames_dropped", status.dropped);
  value("frames_damaged", status.link.damaged);
  value("underruns", status.link.underruns);
  value("packets_resent", status.link.packets_resent);
  value("packets_missing", status.link.packets_missing);
  value("losses", status.losses);
  value("settings_ignored", std::count_if(status.differences.begin(), status.differences.end(),
                                          [](const auto& d) { return !d.rounded; }));
}

/// Values of one camera that are also summed over the node; `queue_frames` is the maximum instead.
void report_sums(const std::string& camera, const capture::CameraWorkerStatus& status,
                 int64_t missing, int64_t waiting, wire::HealthMessage& health) {
  const bool streaming =
      status.state != capture::CameraState::kOpening && status.state != capture::CameraState::kLost;
  health.values[camera + ".frames_missing"] = static_cast<double>(missing);
  health.values[camera + ".streaming_flag"] = streaming ? 1 : 0;
  health.values[camera + ".queue_frames"] = static_cast<double>(waiting);
  health.values["frames_missing"] += static_cast<double>(missing);
  health.values["frames_suspect"] += static_cast<double>(status.suspect);
  health.values["cameras_streaming"] += streaming ? 1 : 0;
  double& longest = health.values["queue_frames"];
  longest = std::max(longest, static_cast<double>(waiting));
}

}  // namespace

void CameraMonitor::report(const capture::CameraWorker& worker, int64_t due,
                           wire::HealthMessage& health) {
  const capture::CameraWorkerStatus status = worker.status();
  const std::string& camera = worker.camera();
  const int64_t missing = std::max<int64_t>(0, due - status.frames);
  report_counters(camera, status, health);
  report_last_frame(camera, status.link, health);
  report_device(camera, status.device, health);
  report_sums(camera, status, missing, worker.waiting(), health);
  health.values[camera + ".frames_per_second"] =
      rates_.rate(camera, status.frames, Monotonic::now());
  report_missing(camera, missing, due);
  report_suspect(camera, status);
  report_differences(camera, status);
}

void CameraMonitor::report_differences(const std::string& camera,
                                       const capture::CameraWorkerStatus& status) {
  std::vector<std::string> ignored;
  for (const capture::SettingDifference& d : status.differences) {
    if (!d.rounded)
      ignored.push_back(d.setting + " (expected " + d.asked + ", found " + d.got + ")");
  }
  events_.report_condition(wire::Severity::kWarning, camera,
                           ignored.empty() ? "" : "ignores settings: " + join_names(ignored),
                           node::advice::kSettingsIgnored);
}

void CameraMonitor::report_missing(const std::string& camera, int64_t missing, int64_t due) {
  if (missing == 0 || !reported_[camera].missing.is_report_due(missing, Monotonic::now())) return;
  events_.send(wire::Severity::kWarning, camera,
               format_count(missing) + " frames missing of " + format_count(due) + " pulses",
               node::advice::kFramesMissing);
}

void CameraMonitor::report_suspect(const std::string& camera,
                                   const capture::CameraWorkerStatus& status) {
  const bool is_report_due = status.suspect > 0 && reported_[camera].suspect.is_report_due(
                                                       status.suspect, Monotonic::now());
  if (!is_report_due) return;
  events_.send(wire::Severity::kWarning, camera,
               format_count(status.suspect) +
                   " frames with a suspect pulse number, the last near " +
                   std::to_string(status.last_pulse),
               node::advice::kFramesSuspect);
}

std::string camera_settings_text(
    const std::string& node, const std::map<std::string, capture::CameraWorkerStatus>& cameras) {
  TomlWriter file;
  file.comment("The cameras of " + node + ", and settings that differ from the studio file.");
  file.comment("v3d-captured writes this file when it opens a camera.");
  for (const auto& [name, status] : cameras) {
    if (status.size.pixels() == 0) continue;
    file.element("camera").text("name", name).text("device", status.device.text());
  }
  for (const auto& [name, status] : cameras) {
    for (const capture::SettingDifference& difference : status.differences) {
      file.element("difference").text("camera", name).text("setting", difference.setting);
      file.text("asked", difference.asked).text("got", difference.got);
      file.boolean("rounded", difference.rounded);
    }
  }
  return file.written();
}

void CameraSettingsFile::update(const std::string& text) {
  if (text == last_) return;
  last_ = text;
  const io::Status written = io::replace_file(path_, text);
  if (!written) spdlog::warn("{}", written.error().message);
}

namespace {

constexpr size_t kQueue = 4;

}  // namespace

FirmwareMonitor::FirmwareMonitor(bus::Bus& bus, const std::vector<std::string>& nodes) {
  for (const std::string& node : nodes) {
    subscriptions_.push_back(std::make_unique<bus::Subscription<wire::HealthMessage>>(
        bus, wire::health_channel(node), kQueue));
  }
}

std::string FirmwareMonitor::differences(const wire::HealthMessage& own) {
  for (const auto& subscription : subscriptions_) {
    while (auto health = subscription->wait(Monotonic::now())) {
      health_[health->node] = std::move(*health);
    }
  }
  health_[own.node] = own;
  return control::firmware_differences(health_);
}

}  // namespace v3d::captured
