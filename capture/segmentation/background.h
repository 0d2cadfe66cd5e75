// Background model: statistics, files, table; parameters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/config/studio_values.h"
#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::segmentation {

// Background model of one camera.

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

// Parameters of the segmentation.

/// Spreads are standard deviations of a sample over the plates (BackgroundModel::spread).
struct SegmentOptions {
  float threshold = 4.5F;    ///< distance from the mean at which a sample differs, in spreads
  float noise_floor = 2.0F;  ///< minimum spread, grey values, 0.5 to 64
  float shake = 0.25F;       ///< camera movement since the plates that counts as 1 spread, pixels
  float shadow_min = 0.5F;   ///< minimum brightness of a shadow, as a part of the background's
  float shadow_chroma = 0.06F;  ///< maximum change of colour in a shadow, as a part of brightness
  // Where the background has the colour of the chroma key, samples within these are background.
  float key_min = 0.25F;     ///< minimum brightness, as a part of the background's
  float key_max = 1.9F;      ///< maximum brightness, as a part of the background's, less than 2
  float key_chroma = 0.12F;  ///< maximum change of colour, as a part of brightness
  int moved = 4;       ///< maximum displacement of background that is still background, pixels
  int min_area = 64;   ///< minimum area of a foreground piece, pixels
  int max_hole = 160;  ///< area from which a hole is kept, pixels
};

// Background model in fixed point for the inner loop of the segmentation: three bytes a sample.

/// Expected value of a saturated sample, in 1/128 grey value.
inline constexpr uint16_t kMaxExpected = 255 << 7;

/// Samples are in the order of the image's bytes. kReach further ones follow, so that a vector load
/// at any sample stays inside the array.
///
/// The scales let a row be processed in 16-bit SIMD lanes. With the expected value e and the
/// image's value s in 1/128 grey value:
///   e = min(mean * gain >> 16, kMaxExpected)      (gain: see brightness_ratio())
///   distance = |s - e| * (sharpness << sharpness_shift) >> 16
/// A distance of one spread is `steps_per_spread`.
struct BackgroundTable {
  static constexpr size_t kReach = 256;

  /// Requires one mean and one spread for each sample of an image of the model's size and format.
  BackgroundTable(const BackgroundModel& model, const SegmentOptions& options);

  ImageSize size;
  PixelFormat format;
  int channels;                    ///< samples per pixel
  std::vector<uint16_t> mean;      ///< 1/256 grey value
  std::vector<uint8_t> sharpness;  ///< inverse of the spread; 255 for the minimum spread
  int sharpness_shift;
  float steps_per_spread;  ///< 4 to 8
  /// Bit (x, y): the quad of columns x, x + 1 and rows y, y + 1 has the key's colour. Size 0 x 0 if
  /// there is no key.
  Mask keyed;
};

// Adapts the background model to slow changes of the light, such as sun or warming lamps.

/// Updates are slow and bounded, so that a performer who stands still is never learnt:
/// - Only samples within 3 spreads of the expected background are updated, and none within a cell
///   of the mask, at least 16 pixels. This excludes cloth of nearly the wall's colour, and shadows
///   darker than noise.
/// - A sample's mean moves by 1/16 of the difference, at most by 1/4 grey value.
/// - In total it moves away from the plates by at most a quarter plus 8 grey values.
/// Only means change; drift of the light says nothing about a sample's noise.
/// Not thread-safe.
class BackgroundAdaptation {
 public:
  explicit BackgroundAdaptation(const BackgroundTable& plates) : plates_(plates.mean) {}

  /// Moves the table's means towards the image. Requires that `mask` is the segmentation of `image`
  /// by the table at brightness `gain`. Integer arithmetic: every processor gives the same table.
  void adapt(ImageView image, const Mask& mask, uint32_t gain, BackgroundTable& table);

  /// Restores the means of the plates.
  void restore_plates(BackgroundTable& table) const { table.mean = plates_; }

 private:
  void mark_busy_cells(const Mask& mask);

  std::vector<uint16_t> plates_;   ///< initial BackgroundTable::mean
  std::vector<uint8_t> busy_;      ///< per cell: foreground in the cell or in a neighbour
  std::vector<uint8_t> occupied_;  ///< per cell: foreground in the cell
  std::vector<uint8_t> tail_;      ///< the last samples of an image
};

}  // namespace v3d::segmentation
