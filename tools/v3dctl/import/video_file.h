// Videos as files, through FFmpeg's libraries: the only place of the tools that sees them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "base/image.h"

namespace v3d::ctl {

/// Decodes the video of a file once, from the first frame to the last. Frames keep the orientation
/// of the sensor: a rotation that the file requests is ignored, because calibrations belong to the
/// sensor. Only the file itself is read, never files that it names. One thread.
class VideoFile {
 public:
  /// Throws InputError when the file is missing, not a regular file, or no video.
  explicit VideoFile(const std::filesystem::path& path);
  ~VideoFile();
  VideoFile(VideoFile&&) noexcept;

  /// Frames per second according to the file; 0 where it has no rate.
  double rate_hz() const;
  /// Number of frames according to the file; 0 where it has none. A damaged file may have fewer.
  int64_t announced_frames() const;
  /// The next frame as RGB8; empty behind the last. Throws InputError
  /// - where the file is damaged, with the number (from 0) and time of the first frame that is not
  ///   returned. The damage may lie some frames later, as many as the decoder reorders;
  /// - where the size changes, with the frame's number and both sizes.
  std::optional<Image> next();
  /// Decodes the next frame without converting it; false behind the last. Throws as next().
  bool skip();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::ctl
