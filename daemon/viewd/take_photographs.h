// Single frames of recorded takes, for people to look at.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <optional>
#include <string>
#include <vector>

#include "base/colour_response.h"
#include "base/time.h"
#include "daemon/viewd/file_stamp.h"
#include "take/logs/frame_log.h"

namespace v3d {

/// Keeps the logs that were asked for last open, with their indices: of a log a frame is read, and
/// nothing else. One thread.
class TakePhotographs {
 public:
  static constexpr size_t kMaxLogs = 64;  ///< open at a time: those of a large studio's take

  /// `takes`: the folder that holds them.
  explicit TakePhotographs(std::filesystem::path takes) : takes_(std::move(takes)) {}

  /// JPEG of the whole image, its colours corrected as the take's calibration says, like those of
  /// its meshes. Empty where the camera has no such frame, or it is damaged. Both names must be
  /// is_file_name(). Throws InputError where the log is none.
  std::optional<std::vector<uint8_t>> read(const std::string& take, int64_t pulse,
                                           const std::string& camera);

 private:
  /// A log that grows is indexed anew when it is asked for what it did not have, but no more often.
  static constexpr Duration kIndexLasts = std::chrono::seconds(1);

  struct OpenLog {
    std::filesystem::path path;
    FileStamp stamp;
    MonotonicInstant opened;
    FrameLogReader reader;
    ColourResponse colour;
  };
  /// Null where there is no such file. The front of `logs_` is what was used last.
  OpenLog* find(const std::string& take, const std::string& camera);
  OpenLog* open(const std::string& take, const std::string& camera, const FileStamp& stamp);
  std::optional<Frame> frame(const std::string& take, int64_t pulse, const std::string& camera);

  const std::filesystem::path takes_;
  std::list<OpenLog> logs_;
};

}  // namespace v3d
