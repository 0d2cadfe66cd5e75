// Health of the machine: processor, memory and temperature, from /proc and /sys.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace v3d {

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
  ///   temperature_max_celsius   of the hottest thermal zone, else of the hottest hwmon sensor
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
  std::optional<double> hottest(const std::string& folder, const std::string& prefix,
                                const std::string& suffix) const;

  const std::filesystem::path root_;
  std::optional<Ticks> last_;
  std::optional<double> machine_percent_;
  std::optional<double> daemon_percent_;
};

}  // namespace v3d
