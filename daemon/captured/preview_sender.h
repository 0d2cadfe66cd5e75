// Small pictures of one camera, for people who want to see what it sees.
#pragma once

#include <cstdint>
#include <string>

#include "base/image.h"
#include "base/mask.h"
#include "daemon/bus/bus.h"

namespace v3d {

/// One thread.
class PreviewSender {
 public:
  /// `bus` outlives the sender. `rate_hz`: of the pulses.
  PreviewSender(Bus& bus, std::string camera, double rate_hz);

  /// About one pulse a second, the same on all cameras: a sheet of them shows one instant.
  bool wants(int64_t pulse) const { return pulse >= 0 && pulse % every_ == 0; }
  /// `mask`: of the raw picture, or null.
  void send(int64_t pulse, ImageView raw, const Mask* mask);

 private:
  Bus& bus_;
  const std::string camera_;
  const int64_t every_;
  int64_t seq_ = 0;
};

}  // namespace v3d
