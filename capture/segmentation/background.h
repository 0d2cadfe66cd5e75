// What one camera sees of the empty studio.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/config/chroma_key.h"
#include "base/image/image.h"

namespace v3d {

/// The empty studio as one camera sees it: per sample (pixel of a Bayer or mono image, channel of
/// RGB) the mean and the standard deviation over the plates, in grey values.
struct BackgroundModel {
  ImageSize size;
  PixelFormat format = PixelFormat::kMono8;
  std::vector<float> mean;
  std::vector<float> spread;
  ChromaKey key = ChromaKey::kNone;  ///< where the means have this colour, brightness tells nothing
};

/// Requires at least 2 plates of one size and format; throws InputError otherwise. Plates that are
/// brighter or darker than the others as a whole (flicker) are brought to the same brightness
/// first.
BackgroundModel learn_background(const std::vector<ImageView>& plates);

/// <folder>/<camera>.mean.png and .spread.png, 16 bit, value * 256; <camera>.toml tells the pixel
/// format and, where there is one, the chroma key. Loading what was saved and saving again gives
/// the same bytes.
void save_background(const std::filesystem::path& folder, const std::string& camera,
                     const BackgroundModel& model);
/// Reads regular files of the folder: no symbolic links, at most 256 MiB a picture and 8 MiB of
/// TOML. The folder itself may be a link. Throws InputError with file and cause.
BackgroundModel load_background(const std::filesystem::path& folder, const std::string& camera);
/// Whether all files of a model are there. Throws InputError on an error of the disk.
bool has_background(const std::filesystem::path& folder, const std::string& camera);

}  // namespace v3d
