// What the segmentation can be told.
#pragma once

namespace v3d {

struct SegmentOptions {
  float threshold = 4.5F;    ///< a sample differs when it is so many spreads from the mean
  float noise_floor = 2.0F;  ///< the least spread assumed, grey values, 0.5 to 64
  float shake = 0.25F;  ///< pixels that the camera may have moved since the plates count one spread
  float shadow_min = 0.5F;      ///< a shadow keeps at least this part of the brightness
  float shadow_chroma = 0.06F;  ///< and its colour to this much
  float key_min = 0.25F;  ///< where the background has the key's colour: at least this part of the
  float key_most = 1.9F;  ///< brightness, at most this, less than 2,
  float key_chroma = 0.12F;  ///< and the colour to this much, is background
  int moved = 4;      ///< pieces that show background from up to so many pixels away are background
  int min_area = 64;  ///< smaller foreground pieces are dropped, pixels
  int max_hole = 160;  ///< smaller holes are filled, pixels
};

}  // namespace v3d
