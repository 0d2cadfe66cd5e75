// Health of this machine, its size, and detection of a second process with its name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "daemon/bus/bus.h"
#include "wire/messages.h"

namespace v3d::node {

// Health of the machine: processor, memory and temperature, from /proc and /sys; on the appliance,
// what its programs count.

/// Values that cannot be read are omitted. One thread.
class MachineHealth {
 public:
  /// `root`: the folder with proc/ and sys/.
  explicit MachineHealth(std::filesystem::path root = "/") : root_(std::move(root)) {}

  /// Adds the values that are available:
  ///   cpu_machine_percent       of all cores together, 0 to 100, since the last call
  ///   cpu_daemon_percent        of one core, may exceed 100, since the last call
  ///   memory_daemon_bytes       resident set of this process
  ///   memory_available_bytes    available without swapping
  ///   temperature_max_celsius   of the hottest of thermal zones and the processor's hwmon sensors;
  ///                             without one, of the hottest hwmon sensor. The kernel has no zone
  ///                             for AMD processors, and an input of a board that is not connected
  ///                             shows 127 degrees.
  /// On the appliance, from the lines "name value" of run/v3d-appliance/health (docs/appliance.md):
  ///   slot_number               the slot that runs: 1 for A, 2 for B
  ///   slot_trial_flag           1 until the slot has started well after an update
  ///   boot_count                starts since the data partition was made
  ///   unclean_starts            how many of them followed no shutdown: power, watchdog, a panic
  ///   watchdog_resets           how many of them followed a reset by the hardware watchdog; absent
  ///                             where its driver does not report resets
  ///   disk_smart_failed_flag    1 when a disk reports by SMART that it fails
  ///   disk_wear_percent         share of the rated writes that the most worn disk has had
  /// Processor values are absent at the first call. Calls less than half a second apart repeat
  /// them.
  void report(std::map<std::string, double>& values);

 private:
  static constexpr int64_t kMinTicks = 50;  ///< per core: half a second

  /// Clock ticks since boot.
  struct Ticks {
    int64_t busy = 0;
    int64_t all = 0;
    int64_t daemon = 0;
    int cores = 1;
  };
  std::optional<Ticks> read_ticks() const;
  void update_processor_time();
  std::optional<double> hottest() const;
  void report_appliance(std::map<std::string, double>& values) const;

  const std::filesystem::path root_;
  std::optional<Ticks> last_;
  std::optional<double> machine_percent_;
  std::optional<double> daemon_percent_;
};

/// Version of the appliance's system: IMAGE_VERSION of os-release(5) where IMAGE_ID is
/// v3d-appliance. Empty on another machine. `root`: the folder with etc/.
std::string appliance_version(const std::filesystem::path& root = "/");
/// `program`, on the appliance with its system as build metadata (semver.org): "1.4.0+SYSTEM".
std::string version_with_appliance(std::string program, const std::filesystem::path& root = "/");

// Duplicate name detection: finds another process that sends health under this node's name.

/// Each process puts a random number into its health (`instance`). Authentic health of this node
/// with another number comes from another process: two PCs have the same node name, or a daemon
/// was started twice. One thread.
class NameMonitor {
 public:
  /// The alarm ends this long after the last message of the other process.
  static constexpr Duration kAlarmTime = std::chrono::seconds(3);
  /// Name of a health value: the random number of the process.
  static constexpr const char* kInstance = "instance";

  /// `bus` outlives the monitor.
  NameMonitor(bus::Bus& bus, std::string node);

  /// Adds this process' number to a health message before it is sent.
  void mark(wire::HealthMessage& health) const;
  /// One line for the operator while another process uses the name at `now`, else empty. Starts
  /// with its second message: the first may be the last one of a process that has just ended.
  std::string alarm(MonotonicInstant now);

 private:
  void on_health(const wire::HealthMessage& health, MonotonicInstant now);

  const std::string node_;
  const double instance_;
  double other_ = 0;
  int64_t messages_of_other_ = 0;
  std::optional<MonotonicInstant> last_of_other_;
  bus::Subscription<wire::HealthMessage> healths_;
};

// Health of nodes with many cameras: at most as long as its receivers accept.

/// One line of problems, one of each camera: the first eight of them, and the number of the others.
std::string join_camera_problems(const std::vector<std::string>& problems);

/// Shortens `health` to at most `max_bytes` when encoded, and names in `health.text` what was
/// removed. Performs these steps in order, and stops after the first one that suffices:
/// 1. shortens `health.text`
/// 2. removes the texts of cameras
/// 3. removes the values of cameras except frames, missing frames and streaming
/// 4. removes all values of cameras
///
/// Requires `max_bytes` of at least bus::kMaxUnverifiedHealth: the result of step 4 is shorter.
void shorten_health(wire::HealthMessage& health, size_t max_bytes);

}  // namespace v3d::node
