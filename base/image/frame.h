// Frame: the image of one camera at one pulse, from the driver to the reconstruction.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d {

/// The pulse that exposed a frame, and the values that identify it.
struct FrameLabel {
  int64_t pulse = -1;    ///< counted from 0 in every take
  bool suspect = false;  ///< the device time stamp and the frame counter disagree about `pulse`
  uint64_t camera_counter = 0;  ///< frame number of the camera
  DeviceInstant device_time;    ///< start of exposure on the camera's clock
  RealtimeInstant received;     ///< when the last byte arrived at this host
  friend bool operator==(const FrameLabel&, const FrameLabel&) = default;
};

/// A frame, raw or live.
/// A raw frame (in a take) has `roi` = whole image and usually no mask. A live frame (on the
/// network) has the mask of the whole image and the pixels inside `roi`, the neighbourhood of the
/// mask. observe() converts a raw frame to a live one.
struct Frame {
  std::string camera;
  FrameLabel label;
  ImageSize sensor_size;     ///< size of the whole image
  std::optional<Mask> mask;  ///< size() == sensor_size
  Rect roi;                  ///< position of `image` in the whole image; x0 and y0 are even
  Image image;               ///< the pixels inside roi
  /// Pixels that differ from the background plates, size() == sensor_size. They restrict colours,
  /// not silhouettes. Only a recorded frame has it whose mask was stored, where there are plates;
  /// no message contains it.
  std::optional<Mask> background_difference{};
};

/// Reduces a raw frame to what the reconstruction needs: the mask, and the pixels of its bounding
/// box, enlarged by `margin` pixels and to even coordinates.
/// Live and offline reconstruction use the same function, so that their results are identical to
/// the bit.
/// Requires: mask.size() == raw.size, and `raw` is the whole image.
Frame observe(const std::string& camera, const FrameLabel& label, ImageView raw, Mask mask,
              int margin = 2);

}  // namespace v3d
