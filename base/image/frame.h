// A frame: what one camera saw at one pulse, from the driver to the reconstruction.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d {

/// Which pulse exposed a frame, and how that is known.
struct FrameLabel {
  int64_t pulse = -1;    ///< counted from 0 in every take
  bool suspect = false;  ///< the device time stamp and the frame counter disagree about `pulse`
  uint64_t camera_counter = 0;  ///< the camera's own frame number
  DeviceInstant device_time;    ///< start of exposure on the camera's clock
  RealtimeInstant received;     ///< the last byte arrived in this host
  friend bool operator==(const FrameLabel&, const FrameLabel&) = default;
};

/// Raw frames (in a take) have `roi` = whole image and usually no mask. Live frames (on the wire)
/// have the mask of the whole image and the pixels inside `roi`, the mask's neighbourhood; both are
/// what observe() makes of a raw frame.
struct Frame {
  std::string camera;
  FrameLabel label;
  ImageSize sensor_size;     ///< of the whole image
  std::optional<Mask> mask;  ///< size() == sensor_size
  Rect roi;                  ///< where `image` lies in the whole image; even x0, y0
  Image image;               ///< the pixels inside roi
};

/// What the reconstruction needs of a raw frame: the mask, and the pixels of its bounding box grown
/// by `margin` and to even coordinates. The same function serves live and offline, so results agree
/// to the bit. Requires: mask.size() == raw.size, raw the whole image.
Frame observe(const std::string& camera, const FrameLabel& label, ImageView raw, Mask mask,
              int margin = 2);

}  // namespace v3d
