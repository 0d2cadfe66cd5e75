// Publishes small JPEG previews of one camera, about one per second.
#pragma once

#include <cstdint>
#include <string>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "daemon/bus/bus.h"

namespace v3d {

/// One thread.
class PreviewSender {
 public:
  /// `bus` outlives the sender. `rate_hz`: of the pulses.
  PreviewSender(Bus& bus, std::string camera, double rate_hz);

  /// True for about one pulse per second. All cameras choose the same pulses, so that a contact
  /// sheet shows one instant.
  bool wants(int64_t pulse) const { return pulse >= 0 && pulse % every_ == 0; }
  /// `raw`: the raw image. `mask`: its mask, or null. Does nothing for an image too large for a
  /// preview message.
  void send(int64_t pulse, ImageView raw, const Mask* mask);

 private:
  Bus& bus_;
  const std::string camera_;
  const int64_t every_;  ///< pulses
  int64_t seq_ = 0;
};

}  // namespace v3d
