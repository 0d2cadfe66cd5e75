// Parameters of the segmentation.
#pragma once

namespace v3d {

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

}  // namespace v3d
