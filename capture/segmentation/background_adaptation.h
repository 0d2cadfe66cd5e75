// Lets the background follow the light: the sun comes round, lamps grow warm.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/background_table.h"

namespace v3d {

/// Slow, and within bounds, so that nobody is ever learnt into the background, however long he
/// stands:
/// - only samples that lie about where the background is expected learn, no more than 3 spreads
///   away, and none within a cell of the mask, 16 pixels at the least: no cloth that is nearly the
///   wall's colour, and no shadow that is more than noise;
/// - a sample's mean moves by a sixteenth of the difference, and by 1/4 grey value at most;
/// - in all it goes no further than a quarter and 8 grey values from the plates.
/// The means alone change: how far light drifts tells nothing of a sample's noise.
class BackgroundAdaptation {
 public:
  explicit BackgroundAdaptation(const BackgroundTable& plates) : plates_(plates.mean) {}

  /// Moves the table's means towards the image. Requires: mask is what the table makes of the image
  /// in its brightness `gain`. Integers only: every processor gives the same table.
  void follow(ImageView image, const Mask& mask, uint32_t gain, BackgroundTable& table);

  /// Back to the plates.
  void forget(BackgroundTable& table) const { table.mean = plates_; }

 private:
  void mark_busy_cells(const Mask& mask);

  std::vector<uint16_t> plates_;  ///< BackgroundTable::mean as it was
  std::vector<uint8_t> busy_;     ///< per cell: the mask has foreground in it, or around it
  std::vector<uint8_t> occupied_;
  std::vector<uint8_t> tail_;  ///< the last samples of an image
};

}  // namespace v3d
