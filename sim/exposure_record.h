// exposures.csv: the simulator's own record of which edge every image of every camera shows: a line
// for each time an image is sent, none for one that is not. It is what a recorded take is checked
// against.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"

namespace v3d::sim {

/// The image_index of an image that a fault has made black.
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

/// Appends lines, each flushed at once. Any thread.
class ExposureRecord {
 public:
  /// Replaces the file. Throws InputError.
  explicit ExposureRecord(const std::filesystem::path& path);
  /// Counts what the disk refused instead of throwing.
  void add(const ExposureLine& line);
  int64_t lost() const;

 private:
  mutable std::mutex mutex_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  int64_t lost_ = 0;
};

/// Throws InputError naming file, line and field.
std::vector<ExposureLine> load_exposures(const std::filesystem::path& path);
/// The same from text; `path` names it in messages.
std::vector<ExposureLine> parse_exposures(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d::sim
