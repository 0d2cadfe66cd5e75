// Monitoring of cameras: health and events, the file of their settings, their firmware.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "capture/cameras/camera_worker.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/event_sender.h"
#include "wire/messages.h"

namespace v3d::captured {

// Converts counters that are sampled now and then into rates.

/// One thread.
class RateMeter {
 public:
  /// Counts per second since the last sample of this counter; 0 at the first sample. A sample less
  /// than 0.5 s after the last one is ignored, and the previous rate returned. A counter that has
  /// decreased was restarted from 0.
  double rate(const std::string& counter, int64_t count, MonotonicInstant now) {
    const auto [found, is_new] = samples_.try_emplace(counter, Sample{count, now, 0});
    Sample& last = found->second;
    const double seconds = to_seconds(now - last.at);
    if (is_new || seconds < kMinSeconds) return last.rate;
    const int64_t counted = count < last.count ? count : count - last.count;
    last = {count, now, static_cast<double>(counted) / seconds};
    return last.rate;
  }

 private:
  static constexpr double kMinSeconds = 0.5;
  struct Sample {
    int64_t count = 0;
    MonotonicInstant at;
    double rate = 0;
  };
  std::map<std::string, Sample> samples_;
};

/// One thread.
class CameraMonitor {
 public:
  /// `events` outlives the monitor.
  explicit CameraMonitor(bus::EventSender& events) : events_(events) {}

  /// Call when a train starts: frames are counted from 0.
  void reset();
  /// Sends an event when the camera was lost or came back since the last call. Call it often.
  void update(const capture::CameraWorker& worker);
  /// Adds the camera's numbers, model and firmware to `health`. Sends events about ignored
  /// settings, and about missing and suspect frames, as often as EventThrottle allows. `due`:
  /// frames that should have arrived by now; 0 for a camera that no take records.
  void report(const capture::CameraWorker& worker, int64_t due, wire::HealthMessage& health);

 private:
  /// What was reported about one camera.
  struct Reported {
    int64_t losses = 0;
    bool lost = false;
    bus::EventThrottle suspect;
    bus::EventThrottle missing;
  };

  void report_missing(const std::string& camera, int64_t missing, int64_t due);
  void report_differences(const std::string& camera, const capture::CameraWorkerStatus& status);
  void report_suspect(const std::string& camera, const capture::CameraWorkerStatus& status);

  bus::EventSender& events_;
  RateMeter rates_;
  std::map<std::string, Reported> reported_;  ///< by camera
};

// File about the cameras of a node: models, firmware, and settings that differ from the studio
// file.

/// TOML: [[camera]] name, device, and [[difference]] camera, setting, asked, got, rounded, for each
/// camera by name. Cameras that were never opened are absent.
std::string camera_settings_text(const std::string& node,
                                 const std::map<std::string, capture::CameraWorkerStatus>& cameras);

/// .camera-settings-NODE.toml in the folder of takes. One thread.
class CameraSettingsFile {
 public:
  explicit CameraSettingsFile(std::filesystem::path path) : path_(std::move(path)) {}

  /// Replaces the file when its content would differ from that of the last call. An error is
  /// logged; the next call with another content tries again.
  void update(const std::string& text);

 private:
  const std::filesystem::path path_;
  std::string last_;
};

// Watches that the cameras of one model have the same firmware in the whole studio.

/// Reads the models and firmware of the cameras of other nodes from their health. The trigger's
/// node has one, so the studio reports a difference once. One thread.
class FirmwareMonitor {
 public:
  /// `nodes`: the other capture nodes. `bus` outlives the monitor.
  FirmwareMonitor(bus::Bus& bus, const std::vector<std::string>& nodes);

  /// Reads the messages that have arrived; never waits. Returns control::firmware_differences() of
  /// them and of `own`, the health of this node. A node that falls silent keeps its last cameras.
  std::string differences(const wire::HealthMessage& own);

 private:
  std::vector<std::unique_ptr<bus::Subscription<wire::HealthMessage>>> subscriptions_;
  std::map<std::string, wire::HealthMessage> health_;  ///< last of each node
};

}  // namespace v3d::captured
