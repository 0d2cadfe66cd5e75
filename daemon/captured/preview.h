// Previews: images and sending.
#pragma once

#include <cstdint>
#include <string>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "daemon/bus/bus.h"

namespace v3d::captured {

// Publishes small JPEG previews of one camera, about one per second.

/// One thread.
class PreviewSender {
 public:
  /// `bus` outlives the sender. `rate_hz`: of the pulses.
  PreviewSender(bus::Bus& bus, std::string camera, double rate_hz);

  /// True for about one pulse per second. All cameras choose the same pulses, so that a contact
  /// sheet shows one instant.
  bool is_due(int64_t pulse) const { return pulse >= 0 && pulse % every_ == 0; }
  /// `raw`: the raw image. `mask`: its mask, or null. Does nothing for an image too large for a
  /// preview message, or with a single row or column.
  void send(int64_t pulse, ImageView raw, const Mask* mask);

 private:
  bus::Bus& bus_;
  const std::string camera_;
  const int64_t every_;  ///< pulses
  int64_t seq_ = 0;
};

// Preview images and masks at half resolution.

/// RGB8 image of half the width and height: every 2x2 quad, which in a Bayer image holds all
/// colours, becomes one pixel. A last odd row or column is left out.
/// Requires at least 2x2 pixels. Pure function.
Image preview_of(ImageView raw);

/// Mask of half the width and height: foreground where any pixel of the 2x2 quad is. Pure function.
Mask preview_mask(const Mask& mask);

}  // namespace v3d::captured
