// Pictures of a board, one after the other: images, a video, or the frames of a take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"

namespace v3d::calibrate {

/// `number`: of the frame in its video, of the pulse in its take, of the file in its list.
struct Picture {
  int64_t number = 0;
  std::string name;  ///< for people: "left01.jpg", "frame 27"
  Image image;
};

/// One thread. Empty behind the last. Throws InputError for files that cannot be read.
struct PictureSource {
  std::string name;       ///< of the file or folder
  int64_t announced = 0;  ///< about so many; 0: unknown
  std::function<std::optional<Picture>()> next;
};

/// Every `every`th frame; 0: so that at most about `most` are looked at.
struct Sampling {
  int every = 0;
  int most = 300;
};

/// Files that match a pattern of the shell ("boards/left*.jpg"), in the order of their numbers.
std::vector<std::filesystem::path> matching_files(const std::string& pattern);

PictureSource open_video(const std::filesystem::path& file, const Sampling& sampling);
/// Images among matching_files(). Throws InputError when there is none.
PictureSource open_images(const std::string& pattern);
/// The frames of one camera of a take.
PictureSource open_take(const std::filesystem::path& take, const std::string& camera,
                        const Sampling& sampling);

}  // namespace v3d::calibrate
