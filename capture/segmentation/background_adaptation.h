// Adapts the background model to slow changes of the light, such as sun or warming lamps.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/background.h"

namespace v3d::segmentation {

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
