// Formats in which cameras send images.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/image/image.h"

namespace v3d {

/// How the samples of an image lie in the bytes that a camera sends.
enum class PixelLayout : uint8_t {
  kPlain,       ///< as in Image
  kLsbPacked,   ///< PFNC "p": a bit stream, first sample in the lowest bits; 4 in 5 or 2 in 3 bytes
  kGigePacked,  ///< GigE Vision "Packed": upper 8 bits, low bits of both samples, upper 8 bits
  kMipi,        ///< MIPI CSI-2: the upper 8 bits of 4 or 2 samples, then a byte with their low bits
  kMsbPacked,   ///< V4L2 'Y10B': a bit stream, first sample in the highest bits; 4 in 5 bytes
  kYuyv,        ///< Y0 U Y1 V
  kUyvy,        ///< U Y0 V Y1
  kNv12,        ///< a plane of Y, then a plane of U and V at half width and height
  kJpeg,        ///< a JPEG image, also without Huffman tables (Motion JPEG)
};

/// A format of the field `pixel_format` in the studio file: the layout that the camera sends, and
/// the format to which the capture layer converts it.
struct CameraFormat {
  PixelFormat image = PixelFormat::kBayerRG8;
  PixelLayout layout = PixelLayout::kPlain;

  CameraFormat() = default;
  // Implicit: each pixel format is also a format of cameras.
  constexpr CameraFormat(PixelFormat format,  // NOLINT(google-explicit-constructor)
                         PixelLayout pixel_layout = PixelLayout::kPlain)
      : image(format), layout(pixel_layout) {}
  friend bool operator==(const CameraFormat&, const CameraFormat&) = default;
};

/// The name in the studio file: that of PFNC; for other layouts "BayerRG10MIPI", "Mono10MSB",
/// "YUYV", "UYVY", "NV12", "MJPEG". Requires a format that camera_format_from_name() returns.
std::string_view name(CameraFormat format);
std::optional<CameraFormat> camera_format_from_name(std::string_view name);
/// PFNC code for GigE Vision and USB3 Vision. Empty for a layout that PFNC lacks.
std::optional<uint32_t> pfnc_code(CameraFormat format);
/// V4L2 four-character code (linux/videodev2.h). Empty for a layout that V4L2 lacks.
std::optional<uint32_t> fourcc_of(CameraFormat format);

/// All formats with a PFNC code.
std::vector<CameraFormat> pfnc_formats();
/// Names of all formats with a PFNC code, and of all with a V4L2 code: "Mono8, BayerGR8, ...".
std::string pfnc_format_names();
std::string v4l2_format_names();

/// Samples that share bytes in the layout: the width of an image must be a multiple. 1, 2 or 4.
int width_step(CameraFormat format);
/// Bytes of a row without padding; `width` is a multiple of width_step(). Of NV12: of a row of one
/// plane. 0 for JPEG.
size_t row_bytes(CameraFormat format, int width);

}  // namespace v3d
