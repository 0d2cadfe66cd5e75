// Videos of scenes, through the program ffmpeg: writing pictures and reading a background.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "base/io/child_process.h"
#include "common/partial_file.h"

namespace v3d::ctl {

struct VideoOptions {
  enum class Codec {
    kByName,  ///< H.264 in .mp4, .mov and .mkv, VP9 in .webm
    kH264,
    kVp9,
    kAv1
  };
  Codec codec = Codec::kByName;
  int quality = 0;  ///< constant rate factor of the codec, smaller is better; 0: for pictures
  /// Level that the file states, "5.1": H.264 only; empty: the encoder chooses, as always for other
  /// codecs.
  std::string level = {};
  /// Numbers of pictures that a player can start from, ascending, besides those that the codec
  /// chooses.
  std::vector<int64_t> key_pictures = {};
  /// A sound file that becomes the sound of the video: AAC in .mp4 and .mov, otherwise Opus; empty:
  /// none.
  std::filesystem::path sound = {};
  /// Timecode of the first picture, counted in pictures ("10:00:03:12", with dropped numbers
  /// "10:00:03;12"): a track of .mp4 and .mov, a tag of other files; empty: none.
  std::string timecode = {};
};

/// A rate for ffmpeg: "30000/1001" for an NTSC rate, "25.000000" for another one. ffmpeg would make
/// 979001/32666 of "29.970030".
std::string frame_rate(double rate_hz);

/// Times of pictures for -force_key_frames of ffmpeg, seconds: "0.058333,0.158333". Each is a
/// quarter of a period before its picture, because ffmpeg 5 takes the picture nearest to a time,
/// and later versions the first that is not before it.
std::string key_picture_times(const std::vector<int64_t>& pictures, double rate_hz);

/// Encodes pictures. The file gets its name, in place of an existing one, when it is complete
/// (PartialFile). One thread.
class VideoWriter {
 public:
  /// Whether the extension of `path` is one of these.
  static bool writes(const std::filesystem::path& path);

  /// Throws InputError without ffmpeg on this PC, for an odd width or height, and as PartialFile().
  VideoWriter(const std::filesystem::path& path, ImageSize size, double rate_hz,
              const VideoOptions& options = {});
  /// Adds a picture, RGB8 of the given size. Throws std::runtime_error after ffmpeg has failed;
  /// ffmpeg prints the cause.
  void add(const Image& picture);
  /// Completes the file. Throws as add() and PartialFile::finish().
  void close();

 private:
  std::filesystem::path path_;
  PartialFile file_;  ///< removed after the end of ffmpeg
  ProcessStream ffmpeg_;
};

/// Decodes a video at a given rate; pictures are scaled and cropped to a given size. After the end
/// of the video the last picture is repeated. One thread.
class VideoReader {
 public:
  /// Throws InputError without ffmpeg on this PC, and for a video whose frames have different
  /// sizes.
  VideoReader(std::filesystem::path path, ImageSize size, double rate_hz);
  /// Picture `number`. Requires numbers that do not decrease. Throws InputError for a video without
  /// frames.
  const Image& picture(int64_t number);

 private:
  std::filesystem::path path_;
  ProcessStream ffmpeg_;
  int64_t next_ = 0;
  Image shown_;
  Image decoded_;
  bool ended_ = false;
};

}  // namespace v3d::ctl
