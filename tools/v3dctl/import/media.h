// Readers of image files (OpenCV) and of video files (FFmpeg).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::ctl {

// Readers of image files, through OpenCV. Only image_file.cc includes it here.

/// Reads an image as RGB8. An EXIF orientation is ignored, because a calibration refers to the
/// sensor. Throws InputError for a file that is missing, truncated or no image.
Image read_image(const std::filesystem::path& path);

/// Reads a mask: foreground has grey values of 128 and more. Throws as read_image().
Mask read_mask(const std::filesystem::path& path);

/// Segmentation of a subject before a black background: foreground is brighter than `level`
/// (maximum of red, green and blue, 0 to 1). It is dilated and then eroded by discs, which closes
/// dark spots.
struct BlackBackground {
  double level = 0;
  int dilate_px = 0;  ///< radius
  int erode_px = 0;   ///< radius
};
/// Requires format RGB8.
Mask mask_before_black(ImageView image, const BlackBackground& black);

/// Whether read_image() supports the extension: .png .jpg .jpeg .bmp .tif .tiff .ppm .pgm .webp
bool has_image_name(const std::filesystem::path& path);

// Reader of video files, through the libraries of FFmpeg. Only video_file.cc includes them.

/// Decodes a video once, from the first frame to the last. A rotation that the file requests is
/// ignored, because a calibration refers to the sensor. Files that the video refers to are not
/// read. One thread.
class VideoFile {
 public:
  /// Throws InputError for a file that is missing, not regular, or no video.
  explicit VideoFile(const std::filesystem::path& path);
  ~VideoFile();
  VideoFile(VideoFile&&) noexcept;

  /// Frames per second according to the file; 0: unknown.
  double rate_hz() const;
  /// Number of frames according to the file; 0: unknown. A damaged file may have fewer.
  int64_t announced_frames() const;
  /// From now on, next() and skip() throw InputError where the times that the file states show that
  /// frames are missing or that the rate varies.
  void require_constant_rate();
  /// Next frame as RGB8; empty after the last. Throws InputError
  /// - where the file is damaged, with the number (from 0) and time of the first frame that is not
  ///   returned. The damage may be some frames later, as many as the decoder reorders;
  /// - where the size changes, with the frame's number and both sizes.
  std::optional<Image> next();
  /// Decodes the next frame without converting it; returns false after the last. Throws as next().
  bool skip();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::ctl
