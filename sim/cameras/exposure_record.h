// exposures.csv: the ground truth of the trigger edge that each image shows. It has one line for
// each sent image. `v3d-sim check` compares recorded takes with it.
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

/// The image_index of an image that a fault replaced by black.
inline constexpr int64_t kBlackImage = -2;

/// A line: camera,device_time_ns,edge_monotonic_ns,edge,image_index.
struct ExposureLine {
  std::string camera;
  DeviceInstant device_time;
  MonotonicInstant edge_time;
  int64_t edge = 0;
  int64_t image_index = -1;  ///< -1: the empty studio; kBlackImage
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

}  // namespace v3d::sim
