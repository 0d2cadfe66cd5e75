// Background model of one camera.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/config/chroma_key.h"
#include "base/image/image.h"

namespace v3d {

/// Mean and standard deviation of every sample over the plates (images of the empty studio), in
/// grey values. A sample is a pixel of a Bayer or mono image, or a channel of an RGB pixel. Samples
/// are in the order of the image's bytes.
struct BackgroundModel {
  ImageSize size;
  PixelFormat format = PixelFormat::kMono8;
  std::vector<float> mean;
  std::vector<float> spread;
  ChromaKey key = ChromaKey::kNone;  ///< where the means have this colour, brightness is ignored
};

/// Learns the model of one camera from its plates. It first scales plates that are brighter or
/// darker than the others as a whole (flicker) to the same brightness.
/// Throws InputError unless there are at least 2 plates, all complete and of one size and format.
BackgroundModel learn_background(const std::vector<ImageView>& plates);

/// Writes <folder>/<camera>.mean.png and .spread.png (16 bits, value * 256) and <camera>.toml, with
/// the pixel format and the chroma key if there is one. Creates the folder. Loading and saving
/// again gives the same bytes.
void save_background(const std::filesystem::path& folder, const std::string& camera,
                     const BackgroundModel& model);
/// Reads a model. Its files must be regular files, not symbolic links, of at most 256 MiB an image
/// and 8 MiB of TOML. The folder itself may be a link. Throws InputError with file and cause.
BackgroundModel load_background(const std::filesystem::path& folder, const std::string& camera);
/// True if all files of a model exist. Throws InputError on a disk error.
bool has_background(const std::filesystem::path& folder, const std::string& camera);

}  // namespace v3d
