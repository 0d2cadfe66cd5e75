// Videos, through the program ffmpeg: the pictures of a scene become one, and one may be its
// background.
#pragma once

#include <filesystem>
#include <optional>

#include "base/image.h"
#include "common/process_stream.h"

namespace v3d::ctl {

/// Pictures to a video (H.264 in .mp4, .mov and .mkv, VP9 in .webm). One thread.
class VideoWriter {
 public:
  /// Whether the name ends like a video that can be written.
  static bool writes(const std::filesystem::path& path);

  /// Throws InputError: no ffmpeg on this PC; a size of odd numbers.
  VideoWriter(const std::filesystem::path& path, ImageSize size, double rate_hz);
  /// RGB8 of that size. Throws std::runtime_error where ffmpeg has ended; it said why.
  void add(const Image& picture);
  /// The video is whole after this. Throws std::runtime_error.
  void close();

 private:
  std::filesystem::path path_;
  ProcessStream ffmpeg_;
};

/// A video's pictures, one after the other, brought to a rate and a size that they fill. The last
/// stays when the video has ended. One thread.
class VideoReader {
 public:
  /// Throws InputError where ffmpeg is missing, and, with the frame's number and both sizes, for a
  /// video whose frames are of different sizes.
  VideoReader(std::filesystem::path path, ImageSize size, double rate_hz);
  /// Picture `number`; requires that numbers never fall. Throws InputError when the video has not
  /// even one.
  const Image& picture(int64_t number);

 private:
  std::filesystem::path path_;
  ProcessStream ffmpeg_;
  int64_t next_ = 0;
  Image shown_;
  Image coming_;
  bool ended_ = false;
};

}  // namespace v3d::ctl
