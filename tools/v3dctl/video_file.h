// Videos as files, through FFmpeg's libraries: the only place of the tools that sees them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "base/image.h"

namespace v3d::ctl {

/// Decodes the video of a file once, from the first frame to the last. Pictures are as they lie in
/// the file: a rotation that the file asks for is ignored, since a calibration belongs to the
/// sensor. A packet that cannot be decoded is passed over. One thread.
class VideoFile {
 public:
  /// Throws InputError when the file is missing, not a regular file, or no video.
  explicit VideoFile(const std::filesystem::path& path);
  ~VideoFile();
  VideoFile(VideoFile&&) noexcept;

  /// What the file says; 0 when it says nothing.
  double rate_hz() const;
  int64_t announced_frames() const;
  /// The next frame as RGB8; empty behind the last. Throws InputError, with the frame's number
  /// (from 0) and both sizes, when its size is another than of the frames before.
  std::optional<Image> next();
  /// Passes over the next frame; false behind the last. Throws as next().
  bool skip();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::ctl
