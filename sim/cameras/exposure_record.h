// Exposures and injected faults.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"

namespace v3d::sim {

// exposures.csv: the ground truth of the trigger edge that each image shows. It has one line for
// each sent image. `v3d-sim check` compares recorded takes with it.

/// The image_index of an image that a fault replaced by black.
inline constexpr int64_t kBlackImage = -2;

/// A line: camera,device_time_ns,edge_monotonic_ns,edge,image_index,xxh3.
struct ExposureLine {
  std::string camera;
  DeviceInstant device_time;
  MonotonicInstant edge_time;
  int64_t edge = 0;
  int64_t image_index = -1;  ///< -1: the empty studio; kBlackImage
  /// XXH3 of the image with 8 bits per sample, 16 hexadecimal digits in the file; 0: not known.
  uint64_t checksum = 0;
  friend bool operator==(const ExposureLine&, const ExposureLine&) = default;
};

/// Appends lines and flushes each one. Thread-safe.
class ExposureRecord {
 public:
  /// Replaces the file. Throws InputError.
  explicit ExposureRecord(const std::filesystem::path& path);
  /// Does not throw; lost() counts write errors.
  void add(const ExposureLine& line);
  int64_t lost() const;

 private:
  mutable std::mutex mutex_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  int64_t lost_ = 0;
};

/// Reads a file. Throws InputError with file, line and field.
std::vector<ExposureLine> load_exposures(const std::filesystem::path& path);
/// Reads a text; `path` is for messages.
std::vector<ExposureLine> parse_exposures(std::string_view text, const std::filesystem::path& path);

// Camera faults that the simulation can inject.

enum class FaultKind : uint8_t {
  kDrop,       ///< the frame is exposed and counted, but not sent
  kMissed,     ///< the trigger is ignored: no exposure, no count
  kDuplicate,  ///< sent twice, with equal time stamps and consecutive frame numbers
  kDelay,      ///< sent late by `time`, like all frames queued after it
  kFreeze,     ///< no exposures and no counts for `pulses` pulses; control works
  kUnplug,     ///< disconnected for `time` from this pulse; the frame counter restarts
  kClock,      ///< the clock jumps by `time` (may be negative) and runs `drift_ppm` faster
  kBlack,      ///< the image is black
  kLate,       ///< from this pulse, images lag by `pulses` pulses; only in takes written without
               ///< daemons
  kSuspect,    ///< the frame counter is wrong; only in takes written without daemons
};

struct Fault {
  std::string camera;
  int64_t pulse = 0;
  FaultKind kind = FaultKind::kDrop;
  int64_t pulses = 1;
  Duration time{};
  double drift_ppm = 0;
  bool new_clock = false;  ///< kUnplug: the clock restarts at 0
};

}  // namespace v3d::sim
