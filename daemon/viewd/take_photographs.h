// Single frames of recorded takes as JPEG images.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "base/image/colour_response.h"
#include "daemon/viewd/served_files.h"
#include "take/logs/frame_log.h"

namespace v3d {

/// Keeps the most recently used logs and their indexes open, so that a frame costs one read. One
/// thread.
class TakePhotographs {
 public:
  static constexpr size_t kMaxLogs = 64;  ///< open logs: one take of a large studio

  /// `takes`: the folder of the takes.
  explicit TakePhotographs(std::filesystem::path takes) : takes_(std::move(takes)) {}

  /// JPEG of the whole image, with the colour correction of the take's calibration, as for its
  /// meshes. Empty if the camera has no such frame, or it is damaged. Requires that is_file_name()
  /// holds for both names. Throws InputError if the file is not a log.
  std::optional<std::vector<uint8_t>> read(const std::string& take, int64_t pulse,
                                           const std::string& camera);

 private:
  /// Shortest time between two indexings of a growing log, when a frame is not found.
  static constexpr Duration kReindexPeriod = std::chrono::seconds(1);

  struct OpenLog {
    std::filesystem::path path;
    FileStamp stamp;
    MonotonicInstant opened;
    FrameLogReader reader;
    ColourResponse colour;
  };
  /// The open log, moved to the front of `logs_`; null if there is no such file.
  OpenLog* find(const std::string& take, const std::string& camera);
  OpenLog* open(const std::string& take, const std::string& camera, const FileStamp& stamp);
  std::optional<Frame> frame(const std::string& take, int64_t pulse, const std::string& camera);

  const std::filesystem::path takes_;
  std::list<OpenLog> logs_;
};

}  // namespace v3d
