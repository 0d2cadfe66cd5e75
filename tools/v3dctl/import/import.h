// Import of images and videos as a take.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/image.h"
#include "base/image/mask.h"
#include "v3dctl/import/media.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

// Images of one camera in temporal order, from image files or a video: frame_source.cc

/// Image files of one camera in temporal order; masks[i] belongs to images[i].
struct ImageSequence {
  std::string camera;
  std::vector<std::filesystem::path> images;
  std::vector<std::filesystem::path> masks;  ///< empty, or as many as images
};

/// Finds the images of all cameras in a folder: CAM.png (one frame), or CAM/FRAME.png.
/// The result has the order of the rig, without cameras that have no images. Images are ordered by
/// name, numbers in names by value; frames have the same names for every camera. Other files are
/// ignored. `masks`: folder of masks under the same names; empty: none.
/// Throws InputError for an image without a camera of the rig, a camera with both kinds of images,
/// different frames, an image without mask or mask without image, and no images at all.
std::vector<ImageSequence> find_images(const std::filesystem::path& images,
                                       const std::filesystem::path& masks, const Rig& rig);

/// Image files in `folder` itself, in the same order.
std::vector<std::filesystem::path> images_in(const std::filesystem::path& folder);

struct SourceImage {
  Image image;  ///< RGB8
  std::optional<Mask> mask;
  std::string where;       ///< file, and frame of a video, for messages
  std::string mask_where;  ///< file of the mask
};

/// One thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Next image; empty after the last. Throws InputError for an unreadable file.
  virtual std::optional<SourceImage> next() = 0;
  /// Skips one image; returns false after the last.
  virtual bool skip() = 0;
  virtual std::string name() const = 0;
  /// Number of images according to the file, for progress; 0: unknown. A video may be wrong.
  virtual int64_t announced() const = 0;
  /// Images per second according to the file; 0: unknown.
  virtual double rate_hz() const = 0;
};

std::unique_ptr<FrameSource> open_images(ImageSequence sequence);
/// Throws InputError as VideoFile does.
std::unique_ptr<FrameSource> open_video(const std::filesystem::path& file);

/// Has either `images` or `videos`.
struct ImportOptions {
  std::filesystem::path take;
  std::filesystem::path calib;
  std::filesystem::path images;          ///< folder
  std::filesystem::path masks;           ///< of the images; empty: none
  std::vector<CameraFile> videos;        ///< one for each camera
  std::vector<CameraFile> backgrounds;   ///< of the empty studio: a video, folder or image
  std::optional<BlackBackground> black;  ///< makes masks from the images
  take::FrameRange frames;
  double rate_hz = 0;  ///< 0: that of the videos, otherwise 25
};

struct ImportResult {
  int64_t frames = 0;
  std::vector<std::string> cameras;
  double rate_hz = 0;
};

/// Throws InputError for bad input; then no take is created.
ImportResult import_take(const ImportOptions& options);

/// Parses "LEVEL" or "LEVEL:GROW:SHRINK": level 0 to 1, radii of dilation and erosion 0 to 100
/// pixels. Throws InputError for other text.
BlackBackground parse_black_background(std::string_view text);

}  // namespace v3d::ctl
