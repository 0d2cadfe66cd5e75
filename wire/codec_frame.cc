#include <algorithm>
#include <array>
#include <utility>

#include "base/core/bytes.h"
#include "v3d/frame_t.hpp"
#include "v3d/preview_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d::wire {
namespace {

constexpr Layout kFrameLayout = "qqssq?qqqiiiiiiib?qnnB0B1";
constexpr int8_t kRawEncoding = 0;
constexpr size_t kChecksumSize = 8;
/// Size of the checksum of a frame_t and the two array counts after it, bytes. The arrays follow.
constexpr size_t kFrameTail = kChecksumSize + 2 * 4;

bool is_side(int32_t n) { return n >= 1 && n <= kMaxImageSide; }

/// The region lies inside the image and starts at even coordinates, which keeps its Bayer pattern.
bool is_valid_roi(const Rect& roi, ImageSize whole) {
  return roi.x0 >= 0 && roi.y0 >= 0 && roi.width >= 0 && roi.height >= 0 && roi.x0 % 2 == 0 &&
         roi.y0 % 2 == 0 && roi.x0 <= whole.width - roi.width &&
         roi.y0 <= whole.height - roi.height;
}

frame_t frame_without_pixels(const FrameMessage& m) {
  const Frame& f = m.frame;
  frame_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.camera = f.camera;
  w.pulse = f.label.pulse;
  w.suspect = f.label.suspect;
  w.camera_counter = static_cast<int64_t>(f.label.camera_counter);
  w.t_exposure_ns = to_ns(f.label.device_time);
  w.t_received_ns = to_ns(f.label.received);
  w.width = f.sensor_size.width;
  w.height = f.sensor_size.height;
  w.roi_x0 = f.roi.x0;
  w.roi_y0 = f.roi.y0;
  w.roi_width = f.roi.width;
  w.roi_height = f.roi.height;
  w.pixel_format = static_cast<int32_t>(f.image.format);
  w.encoding = kRawEncoding;
  w.has_mask = f.mask.has_value();
  if (f.mask) w.runs = encode_runs(*f.mask);
  w.checksum = 0;
  w.n_runs = static_cast<int32_t>(w.runs.size());
  w.n_bytes = 0;
  return w;
}

FrameLabel label_of(const frame_t& w) {
  return {.pulse = w.pulse,
          .suspect = w.suspect != 0,
          .camera_counter = static_cast<uint64_t>(w.camera_counter),
          .device_time = from_ns<DeviceClock>(w.t_exposure_ns),
          .received = from_ns<Realtime>(w.t_received_ns)};
}

/// Decodes the silhouette if there is one. False when it is invalid.
bool read_mask(const frame_t& w, Frame& frame) {
  if (!w.has_mask) return w.n_runs == 0;
  frame.mask = decode_runs(w.runs, frame.sensor_size);
  return frame.mask.has_value();
}

/// Moves the pixels out of `w`, without a copy. False when format, region or size is invalid.
bool take_pixels(frame_t& w, Frame& frame) {
  const auto format = pixel_format_from_code(static_cast<uint32_t>(w.pixel_format));
  if (!format || w.encoding != kRawEncoding) return false;
  frame.roi = {w.roi_x0, w.roi_y0, w.roi_width, w.roi_height};
  if (!is_valid_roi(frame.roi, frame.sensor_size)) return false;
  frame.image.size = {w.roi_width, w.roi_height};
  frame.image.format = *format;
  if (byte_count(frame.image.size, *format) != w.bytes.size()) return false;
  frame.image.bytes = std::move(w.bytes);
  return true;
}

/// Encodes all fields before the pixels, which are the last field. Their count and the checksum
/// precede the runs of the mask.
Bytes pack_head(const FrameMessage& m, size_t room) {
  const frame_t w = frame_without_pixels(m);
  Bytes bytes = pack(w, room);
  const Bytes& pixels = m.frame.image.bytes;
  const std::span fields = std::span(bytes).first(bytes.size() - w.runs.size());
  write_big_endian(pixels.size(), fields.last(4));
  write_big_endian(checksum({bytes, pixels}), fields.last(kFrameTail).first(kChecksumSize));
  return bytes;
}

/// `bytes`: the message from which `w` was decoded.
bool has_valid_checksum(const frame_t& w, std::span<const uint8_t> bytes) {
  constexpr std::array<uint8_t, kChecksumSize> kZero{};
  const auto arrays = static_cast<size_t>(w.n_runs) + static_cast<size_t>(w.n_bytes);
  const size_t at = bytes.size() - arrays - kFrameTail;
  const uint64_t expected = checksum({bytes.first(at), kZero, bytes.subspan(at + kChecksumSize)});
  return static_cast<uint64_t>(w.checksum) == expected;
}

}  // namespace

Bytes encode_head(const FrameMessage& m) { return pack_head(m, 0); }

Bytes encode(const FrameMessage& m) {
  const Bytes& pixels = m.frame.image.bytes;
  Bytes bytes = pack_head(m, pixels.size());
  bytes.insert(bytes.end(), pixels.begin(), pixels.end());
  return bytes;
}

template <>
std::optional<FrameMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<frame_t>(kFrameLayout, bytes);
  if (!w || !is_side(w->width) || !is_side(w->height)) return std::nullopt;
  const auto sent = instant_of(w->utime);
  if (!sent || w->seq < 0 || w->pulse < -1) return std::nullopt;
  FrameMessage m{.sent = *sent, .seq = w->seq, .take = w->take, .frame = {}};
  m.frame.camera = w->camera;
  m.frame.label = label_of(*w);
  m.frame.sensor_size = {w->width, w->height};
  // The checksum is computed before the pixels are moved, but decides last: a fuzzer, which cannot
  // compute it, then reaches the other checks.
  const bool checksum_ok = has_valid_checksum(*w, bytes);
  if (!take_pixels(*w, m.frame) || !read_mask(*w, m.frame) || !checksum_ok) return std::nullopt;
  return m;
}

std::optional<FrameHead> decode_frame_head(std::span<const uint8_t> first_bytes) {
  if (first_bytes.size() < kFingerprintSize) return std::nullopt;
  const auto before = bytes_before_arrays(kFrameLayout, first_bytes.subspan(kFingerprintSize));
  if (!before) return std::nullopt;
  const size_t head_size = kFingerprintSize + *before;
  const auto counts = first_bytes.first(head_size).last(8);
  const size_t arrays = read_big_endian(counts.first(4)) + read_big_endian(counts.last(4));
  // The generated decoder gets the same message with empty arrays.
  Bytes head(first_bytes.begin(), first_bytes.begin() + static_cast<ptrdiff_t>(head_size));
  std::fill(head.end() - 8, head.end(), uint8_t{0});
  const auto w = unpack<frame_t>(kFrameLayout, head);
  if (!w || w->pulse < -1) return std::nullopt;
  return FrameHead{.take = w->take,
                   .camera = w->camera,
                   .label = label_of(*w),
                   .message_size = head_size + arrays};
}

namespace {

constexpr Layout kPreviewLayout = "qqsqii?nnB0B1";

}  // namespace

Bytes encode(const PreviewMessage& m) {
  preview_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.camera = m.camera;
  w.pulse = m.pulse;
  w.width = m.size.width;
  w.height = m.size.height;
  w.has_mask = m.mask.has_value();
  if (m.mask) w.runs = encode_runs(*m.mask);
  w.n_runs = static_cast<int32_t>(w.runs.size());
  w.jpeg = m.jpeg;
  w.n_jpeg = static_cast<int32_t>(w.jpeg.size());
  return pack(w);
}

template <>
std::optional<PreviewMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<preview_t>(kPreviewLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto is_small = [](int32_t side) { return side >= 1 && side <= kMaxPreviewSide; };
  if (!sent || w->seq < 0 || w->pulse < -1 || !is_small(w->width) || !is_small(w->height)) {
    return std::nullopt;
  }
  PreviewMessage m{.sent = *sent,
                   .seq = w->seq,
                   .camera = w->camera,
                   .pulse = w->pulse,
                   .size = {w->width, w->height},
                   .mask = {},
                   .jpeg = std::move(w->jpeg)};
  if (w->has_mask) m.mask = decode_runs(w->runs, m.size);
  const bool mask_ok = w->has_mask ? m.mask.has_value() : w->n_runs == 0;
  if (!mask_ok) return std::nullopt;
  return m;
}

}  // namespace v3d::wire
