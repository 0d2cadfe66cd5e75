// The pictures of one camera in the order of time, from image files or from a video.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/image.h"
#include "base/mask.h"
#include "v3dctl/import/image_folder.h"

namespace v3d::ctl {

struct Picture {
  Image image;  ///< RGB8
  std::optional<Mask> mask;
  std::string where;       ///< the file, and the frame of a video, for messages
  std::string mask_where;  ///< the same of the mask
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Empty behind the last. Throws InputError for an unreadable file.
  virtual std::optional<Picture> next() = 0;
  /// Passes over one picture; false behind the last.
  virtual bool skip() = 0;
  virtual std::string name() const = 0;
  /// How many there seem to be, for progress; 0 when nothing is said. A video may be wrong about
  /// it.
  virtual int64_t announced() const = 0;
  /// Pictures per second as the file says; 0 when it says nothing.
  virtual double rate_hz() const = 0;
};

std::unique_ptr<FrameSource> open_images(ImageSequence sequence);
std::unique_ptr<FrameSource> open_video(const std::filesystem::path& file);

}  // namespace v3d::ctl
