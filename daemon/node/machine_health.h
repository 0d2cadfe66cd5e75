// How the machine is: processor, memory, temperature; from /proc and /sys.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace v3d {

/// Values that cannot be read are left out, never made up. One thread.
class MachineHealth {
 public:
  /// `root`: where proc/ and sys/ are.
  explicit MachineHealth(std::filesystem::path root = "/") : root_(std::move(root)) {}

  /// Adds, as far as the machine tells:
  ///   cpu_machine_percent       of all cores together, 0 to 100, over about a second
  ///   cpu_daemon_percent        of one core, may be over 100, over about a second
  ///   memory_daemon_bytes       resident set of this process
  ///   memory_available_bytes    what can be had without swapping
  ///   temperature_max_celsius   of the hottest thermal zone, or of the hottest hwmon sensor
  void report(std::map<std::string, double>& values);

 private:
  static constexpr int64_t kShortest = 50;  ///< ticks of a core: half a second

  /// Clock ticks since boot.
  struct Ticks {
    int64_t busy = 0;
    int64_t all = 0;
    int64_t daemon = 0;
    int cores = 1;
  };
  std::optional<Ticks> read_ticks() const;
  void note_processor_time();
  std::optional<double> hottest(const std::string& folder, const std::string& prefix,
                                const std::string& suffix) const;

  const std::filesystem::path root_;
  std::optional<Ticks> last_;
  std::optional<double> machine_percent_;
  std::optional<double> daemon_percent_;
};

}  // namespace v3d
