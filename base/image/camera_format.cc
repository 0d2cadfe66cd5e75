#include "base/image/camera_format.h"

#include <algorithm>
#include <array>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr uint32_t fourcc(const char (&text)[5]) {
  uint32_t code = 0;
  for (int i = 0; i < 4; ++i) code |= static_cast<uint32_t>(text[i]) << 8 * i;
  return code;
}

struct FormatEntry {
  std::string_view name;
  CameraFormat format;
  uint32_t pfnc;    ///< 0: none
  uint32_t fourcc;  ///< 0: none
};

constexpr std::array<FormatEntry, 51> kFormats = {{
    {"Mono8", {PixelFormat::kMono8, PixelLayout::kPlain}, 0x01080001, fourcc("GREY")},
    {"BayerGR8", {PixelFormat::kBayerGR8, PixelLayout::kPlain}, 0x01080008, fourcc("GRBG")},
    {"BayerRG8", {PixelFormat::kBayerRG8, PixelLayout::kPlain}, 0x01080009, fourcc("RGGB")},
    {"BayerGB8", {PixelFormat::kBayerGB8, PixelLayout::kPlain}, 0x0108000A, fourcc("GBRG")},
    {"BayerBG8", {PixelFormat::kBayerBG8, PixelLayout::kPlain}, 0x0108000B, fourcc("BA81")},
    {"RGB8", {PixelFormat::kRGB8, PixelLayout::kPlain}, 0x02180014, fourcc("RGB3")},
    {"Mono10", {PixelFormat::kMono10, PixelLayout::kPlain}, 0x01100003, fourcc("Y10 ")},
    {"BayerGR10", {PixelFormat::kBayerGR10, PixelLayout::kPlain}, 0x0110000C, fourcc("BA10")},
    {"BayerRG10", {PixelFormat::kBayerRG10, PixelLayout::kPlain}, 0x0110000D, fourcc("RG10")},
    {"BayerGB10", {PixelFormat::kBayerGB10, PixelLayout::kPlain}, 0x0110000E, fourcc("GB10")},
    {"BayerBG10", {PixelFormat::kBayerBG10, PixelLayout::kPlain}, 0x0110000F, fourcc("BG10")},
    {"Mono12", {PixelFormat::kMono12, PixelLayout::kPlain}, 0x01100005, fourcc("Y12 ")},
    {"BayerGR12", {PixelFormat::kBayerGR12, PixelLayout::kPlain}, 0x01100010, fourcc("BA12")},
    {"BayerRG12", {PixelFormat::kBayerRG12, PixelLayout::kPlain}, 0x01100011, fourcc("RG12")},
    {"BayerGB12", {PixelFormat::kBayerGB12, PixelLayout::kPlain}, 0x01100012, fourcc("GB12")},
    {"BayerBG12", {PixelFormat::kBayerBG12, PixelLayout::kPlain}, 0x01100013, fourcc("BG12")},
    {"Mono10p", {PixelFormat::kMono10, PixelLayout::kLsbPacked}, 0x010A0046, 0},
    {"BayerGR10p", {PixelFormat::kBayerGR10, PixelLayout::kLsbPacked}, 0x010A0056, 0},
    {"BayerRG10p", {PixelFormat::kBayerRG10, PixelLayout::kLsbPacked}, 0x010A0058, 0},
    {"BayerGB10p", {PixelFormat::kBayerGB10, PixelLayout::kLsbPacked}, 0x010A0054, 0},
    {"BayerBG10p", {PixelFormat::kBayerBG10, PixelLayout::kLsbPacked}, 0x010A0052, 0},
    {"Mono12p", {PixelFormat::kMono12, PixelLayout::kLsbPacked}, 0x010C0047, 0},
    {"BayerGR12p", {PixelFormat::kBayerGR12, PixelLayout::kLsbPacked}, 0x010C0057, 0},
    {"BayerRG12p", {PixelFormat::kBayerRG12, PixelLayout::kLsbPacked}, 0x010C0059, 0},
    {"BayerGB12p", {PixelFormat::kBayerGB12, PixelLayout::kLsbPacked}, 0x010C0055, 0},
    {"BayerBG12p", {PixelFormat::kBayerBG12, PixelLayout::kLsbPacked}, 0x010C0053, 0},
    {"Mono10Packed", {PixelFormat::kMono10, PixelLayout::kGigePacked}, 0x010C0004, 0},
    {"BayerGR10Packed", {PixelFormat::kBayerGR10, PixelLayout::kGigePacked}, 0x010C0026, 0},
    {"BayerRG10Packed", {PixelFormat::kBayerRG10, PixelLayout::kGigePacked}, 0x010C0027, 0},
    {"BayerGB10Packed", {PixelFormat::kBayerGB10, PixelLayout::kGigePacked}, 0x010C0028, 0},
    {"BayerBG10Packed", {PixelFormat::kBayerBG10, PixelLayout::kGigePacked}, 0x010C0029, 0},
    {"Mono12Packed", {PixelFormat::kMono12, PixelLayout::kGigePacked}, 0x010C0006, 0},
    {"BayerGR12Packed", {PixelFormat::kBayerGR12, PixelLayout::kGigePacked}, 0x010C002A, 0},
    {"BayerRG12Packed", {PixelFormat::kBayerRG12, PixelLayout::kGigePacked}, 0x010C002B, 0},
    {"BayerGB12Packed", {PixelFormat::kBayerGB12, PixelLayout::kGigePacked}, 0x010C002C, 0},
    {"BayerBG12Packed", {PixelFormat::kBayerBG12, PixelLayout::kGigePacked}, 0x010C002D, 0},
    {"Mono10MIPI", {PixelFormat::kMono10, PixelLayout::kMipi}, 0, fourcc("Y10P")},
    {"BayerGR10MIPI", {PixelFormat::kBayerGR10, PixelLayout::kMipi}, 0, fourcc("pgAA")},
    {"BayerRG10MIPI", {PixelFormat::kBayerRG10, PixelLayout::kMipi}, 0, fourcc("pRAA")},
    {"BayerGB10MIPI", {PixelFormat::kBayerGB10, PixelLayout::kMipi}, 0, fourcc("pGAA")},
    {"BayerBG10MIPI", {PixelFormat::kBayerBG10, PixelLayout::kMipi}, 0, fourcc("pBAA")},
    {"Mono12MIPI", {PixelFormat::kMono12, PixelLayout::kMipi}, 0, fourcc("Y12P")},
    {"BayerGR12MIPI", {PixelFormat::kBayerGR12, PixelLayout::kMipi}, 0, fourcc("pgCC")},
    {"BayerRG12MIPI", {PixelFormat::kBayerRG12, PixelLayout::kMipi}, 0, fourcc("pRCC")},
    {"BayerGB12MIPI", {PixelFormat::kBayerGB12, PixelLayout::kMipi}, 0, fourcc("pGCC")},
    {"BayerBG12MIPI", {PixelFormat::kBayerBG12, PixelLayout::kMipi}, 0, fourcc("pBCC")},
    {"Mono10MSB", {PixelFormat::kMono10, PixelLayout::kMsbPacked}, 0, fourcc("Y10B")},
    {"YUYV", {PixelFormat::kRGB8, PixelLayout::kYuyv}, 0, fourcc("YUYV")},
    {"UYVY", {PixelFormat::kRGB8, PixelLayout::kUyvy}, 0, fourcc("UYVY")},
    {"NV12", {PixelFormat::kRGB8, PixelLayout::kNv12}, 0, fourcc("NV12")},
    {"MJPEG", {PixelFormat::kRGB8, PixelLayout::kJpeg}, 0, fourcc("MJPG")},
}};

const FormatEntry& entry_of(CameraFormat format) {
  const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                   [&](const FormatEntry& e) { return e.format == format; });
  V3D_CHECK(found != kFormats.end());
  return *found;
}

std::optional<uint32_t> unless_zero(uint32_t code) {
  return code == 0 ? std::nullopt : std::optional(code);
}

std::string names_with(uint32_t FormatEntry::*code) {
  std::string names;
  for (const FormatEntry& entry : kFormats) {
    if (entry.*code == 0) continue;
    names += (names.empty() ? "" : ", ") + std::string(entry.name);
  }
  return names;
}

}  // namespace

std::string_view name(CameraFormat format) { return entry_of(format).name; }
std::optional<uint32_t> pfnc_code(CameraFormat format) {
  return unless_zero(entry_of(format).pfnc);
}
std::optional<uint32_t> fourcc_of(CameraFormat format) {
  return unless_zero(entry_of(format).fourcc);
}
std::vector<CameraFormat> pfnc_formats() {
  std::vector<CameraFormat> formats;
  for (const FormatEntry& entry : kFormats) {
    if (entry.pfnc != 0) formats.push_back(entry.format);
  }
  return formats;
}
std::string pfnc_format_names() { return names_with(&FormatEntry::pfnc); }
std::string v4l2_format_names() { return names_with(&FormatEntry::fourcc); }

std::optional<CameraFormat> camera_format_from_name(std::string_view name) {
  const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                   [&](const FormatEntry& e) { return e.name == name; });
  return found == kFormats.end() ? std::nullopt : std::optional(found->format);
}

int width_step(CameraFormat format) {
  switch (format.layout) {
    case PixelLayout::kPlain:
    case PixelLayout::kJpeg:
      return 1;
    case PixelLayout::kLsbPacked:
    case PixelLayout::kMipi:
    case PixelLayout::kMsbPacked:
      return bits_per_sample(format.image) == 10 ? 4 : 2;
    case PixelLayout::kGigePacked:
    case PixelLayout::kYuyv:
    case PixelLayout::kUyvy:
    case PixelLayout::kNv12:
      return 2;
  }
  V3D_CHECK(false);
}

size_t row_bytes(CameraFormat format, int width) {
  const auto samples = static_cast<size_t>(width);
  switch (format.layout) {
    case PixelLayout::kPlain:
      return samples * bytes_per_pixel(format.image);
    case PixelLayout::kLsbPacked:
    case PixelLayout::kMipi:
    case PixelLayout::kMsbPacked:
      return samples * bits_per_sample(format.image) / 8;
    case PixelLayout::kGigePacked:
      return samples / 2 * 3;
    case PixelLayout::kYuyv:
    case PixelLayout::kUyvy:
      return samples * 2;
    case PixelLayout::kNv12:
      return samples;
    case PixelLayout::kJpeg:
      return 0;
  }
  V3D_CHECK(false);
}

}  // namespace v3d
