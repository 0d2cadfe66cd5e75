// Sequences of calibration images: image files, a video, or the frames of a take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"

namespace v3d::calibrate {

/// One image. `number`: of the frame in its video, the pulse in its take, or the file in its list.
struct SourceImage {
  int64_t number = 0;
  std::string name;  ///< for messages: "left01.jpg", "frame 27"
  Image pixels;
};

/// A sequence of images. next() returns nothing after the last image, and throws InputError for
/// files that cannot be read. Use it in one thread.
struct ImageSource {
  std::string name;       ///< of the file or folder
  int64_t announced = 0;  ///< approximate number of images; 0: unknown
  std::function<std::optional<SourceImage>()> next;
};

/// Takes every `every`th frame; 0: chosen so that there are at most about `max_images`.
struct Sampling {
  int every = 0;
  int max_images = 300;
};

/// Files that match a shell pattern ("boards/left*.jpg"), in natural order of their numbers.
std::vector<std::filesystem::path> matching_files(const std::string& pattern);

ImageSource open_video(const std::filesystem::path& file, const Sampling& sampling);
/// The images among matching_files(). Throws InputError where there is none.
ImageSource open_images(const std::string& pattern);
/// The frames of one camera of a take.
ImageSource open_take(const std::filesystem::path& take, const std::string& camera,
                      const Sampling& sampling);

}  // namespace v3d::calibrate
