// Fuzz target: images as cameras send them. An image of the promised size, or none.
#include <cstdlib>
#include <string>

#include "capture/cameras/pixel_decoder.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static constexpr const char* kNames[] = {
      "Mono8",         "RGB8",         "BayerRG10",       "Mono10p",    "BayerRG12p", "YUYV",
      "UYVY",          "Mono10Packed", "BayerGB12Packed", "Mono10MIPI", "NV12",       "Mono10MSB",
      "BayerGR12MIPI", "MJPEG"};
  if (size < 5) return 0;
  const auto format = *v3d::camera_format_from_name(kNames[data[0] % std::size(kNames)]);
  const int step = v3d::width_step(format);
  const v3d::ImageSize wanted{step * (data[1] % 16 + 1), data[2] % 64 + 1};
  const v3d::capture::SentLayout layout{
      format,
      wanted,
      v3d::row_bytes(format, wanted.width) + data[3] % 8,
      {.is_bt709 = (data[4] & 1) != 0, .is_full_range = (data[4] & 2) != 0}};
  auto image = v3d::capture::decode_image(layout, {data + 5, size - 5});
  if (!image) return 0;
  if (image->bytes.size() != v3d::byte_count(wanted, format.image)) std::abort();
  v3d::reduce_to_8_bits(*image);
  if (image->bytes.size() != v3d::byte_count(wanted, image->format)) std::abort();
  return 0;
}
