// Frames for tests. The pixels are pseudo-random and depend on pulse and camera.
#pragma once

#include <string>

#include "wire/messages.h"

namespace v3d::test {

inline wire::FrameMessage recorded_frame(const std::string& camera, int64_t pulse, ImageSize size) {
  wire::FrameMessage m;
  m.seq = pulse;
  m.take = "kendo-07";
  m.frame.camera = camera;
  m.frame.label.pulse = pulse;
  m.frame.label.camera_counter = static_cast<uint64_t>(100 + pulse);
  m.frame.sensor_size = size;
  m.frame.roi = {0, 0, size.width, size.height};
  m.frame.image = Image(size, PixelFormat::kMono8);
  uint32_t noise = static_cast<uint32_t>(pulse) * 2654435761U + static_cast<uint8_t>(camera.back());
  for (uint8_t& pixel : m.frame.image.bytes) {
    noise = noise * 1664525 + 1013904223;
    pixel = static_cast<uint8_t>(noise >> 24);
  }
  return m;
}

}  // namespace v3d::test
