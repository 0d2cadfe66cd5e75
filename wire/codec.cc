#include "wire/codec.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

#include "base/checksum.h"
#include "v3d/command_t.hpp"
#include "v3d/event_t.hpp"
#include "v3d/frame_t.hpp"
#include "v3d/health_t.hpp"
#include "v3d/mesh_t.hpp"
#include "v3d/preview_t.hpp"
#include "v3d/pulse_t.hpp"
#include "v3d/reply_t.hpp"
#include "v3d/shard_mesh_t.hpp"
#include "v3d/shard_t.hpp"
#include "wire/layout.h"

namespace v3d {
namespace {

// As in lcmtypes/. The round trip of every message type fails when one of these is wrong.
constexpr Layout kPulseLayout = "qqsqqq";
constexpr Layout kFrameLayout = "qqssq?qqqiiiiiiib?qnnB0B1";
constexpr Layout kMeshLayout = "qqsqqqqinnS0B1";
constexpr Layout kCommandLayout = "qsqb?sqqnnS0S1m";
constexpr Layout kReplyLayout = "qssqbsssm";
constexpr Layout kHealthLayout = "qqsssbssnS0D0";
constexpr Layout kEventLayout = "qqsbss";
constexpr Layout kPreviewLayout = "qqsqii?nnB0B1";
constexpr Layout kShardLayout = "qqssqqqqnD0";
constexpr Layout kShardMeshLayout = "qqsqqqqinnS0B1s";

constexpr size_t kFingerprintSize = 8;
constexpr int8_t kRawEncoding = 0;
constexpr size_t kChecksumSize = 8;
/// The checksum of a frame_t and the two counts behind it, before its arrays.
constexpr size_t kFrameTail = kChecksumSize + 2 * 4;

int64_t utime_of(RealtimeInstant t) { return to_ns(t) / 1000; }

/// Hostile times stay inside what nanoseconds can count.
std::optional<RealtimeInstant> instant_of(int64_t utime) {
  constexpr int64_t kLimit = INT64_MAX / 1000;
  if (utime < -kLimit || utime > kLimit) return std::nullopt;
  return from_ns<Realtime>(utime * 1000);
}

/// `room`: bytes that the caller will append.
template <class Wire>
Bytes pack(const Wire& wire, size_t room = 0) {
  const auto size = static_cast<size_t>(wire.getEncodedSize());
  Bytes bytes;
  bytes.reserve(size + room);
  bytes.resize(size);
  const int used = wire.encode(bytes.data(), 0, static_cast<int>(size));
  assert(used >= 0);
  bytes.resize(static_cast<size_t>(used));
  return bytes;
}

template <class Wire>
std::optional<Wire> unpack(Layout layout, std::span<const uint8_t> bytes) {
  if (bytes.size() < kFingerprintSize || bytes.size() > INT32_MAX) return std::nullopt;
  if (!fits(layout, bytes.subspan(kFingerprintSize))) return std::nullopt;
  Wire wire;
  const int size = static_cast<int>(bytes.size());
  if (wire.decode(bytes.data(), 0, size) != size) return std::nullopt;
  return wire;
}

template <class Enum>
std::optional<Enum> enumerator(int8_t value, Enum last) {
  if (value < 1 || value > static_cast<int8_t>(last)) return std::nullopt;
  return static_cast<Enum>(value);
}

bool is_side(int32_t n) { return n >= 1 && n <= kMaxImageSide; }

/// The part lies inside the image and keeps its Bayer pattern.
bool is_part(const Rect& roi, ImageSize whole) {
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

/// The silhouette, when there is one; false when it is not right.
bool read_mask(const frame_t& w, Frame& frame) {
  if (!w.has_mask) return w.n_runs == 0;
  frame.mask = decode_runs(w.runs, frame.sensor_size);
  return frame.mask.has_value();
}

/// Takes the pixels out of `w` without a copy.
bool take_pixels(frame_t& w, Frame& frame) {
  const auto format = pixel_format_from_code(static_cast<uint32_t>(w.pixel_format));
  if (!format || w.encoding != kRawEncoding) return false;
  frame.roi = {w.roi_x0, w.roi_y0, w.roi_width, w.roi_height};
  if (!is_part(frame.roi, frame.sensor_size)) return false;
  frame.image.size = {w.roi_width, w.roi_height};
  frame.image.format = *format;
  if (byte_count(frame.image.size, *format) != w.bytes.size()) return false;
  frame.image.bytes = std::move(w.bytes);
  return true;
}

}  // namespace

Bytes encode(const PulseMessage& m) {
  pulse_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.pulse = m.pulse;
  w.t_edge_ns = to_ns(m.edge);
  w.t_edge_monotonic_ns = to_ns(m.edge_monotonic);
  return pack(w);
}

template <>
std::optional<PulseMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<pulse_t>(kPulseLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  if (!sent || w->seq < 0 || w->pulse < 0) return std::nullopt;
  return PulseMessage{.sent = *sent,
                      .seq = w->seq,
                      .take = w->take,
                      .pulse = w->pulse,
                      .edge = from_ns<Realtime>(w->t_edge_ns),
                      .edge_monotonic = from_ns<Monotonic>(w->t_edge_monotonic_ns)};
}

namespace {

void put_big_endian(uint64_t value, std::span<uint8_t> to) {
  for (size_t i = 0; i < to.size(); ++i) {
    to[i] = static_cast<uint8_t>(value >> (8 * (to.size() - 1 - i)));
  }
}

/// The pixels are the last field; their count and the checksum stand before the runs of the mask.
Bytes pack_head(const FrameMessage& m, size_t room) {
  const frame_t w = frame_without_pixels(m);
  Bytes bytes = pack(w, room);
  const Bytes& pixels = m.frame.image.bytes;
  const std::span fields = std::span(bytes).first(bytes.size() - w.runs.size());
  put_big_endian(pixels.size(), fields.last(4));
  put_big_endian(checksum({bytes, pixels}), fields.last(kFrameTail).first(kChecksumSize));
  return bytes;
}

/// `bytes`: the message that `w` was decoded from.
bool checksum_is_right(const frame_t& w, std::span<const uint8_t> bytes) {
  constexpr std::array<uint8_t, kChecksumSize> kZero{};
  const auto arrays = static_cast<size_t>(w.n_runs) + static_cast<size_t>(w.n_bytes);
  const size_t at = bytes.size() - arrays - kFrameTail;
  const uint64_t right = checksum({bytes.first(at), kZero, bytes.subspan(at + kChecksumSize)});
  return static_cast<uint64_t>(w.checksum) == right;
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
  // Judged last: a fuzzer, which cannot make a checksum, reaches everything before it.
  const bool sound = checksum_is_right(*w, bytes);
  if (!take_pixels(*w, m.frame) || !read_mask(*w, m.frame) || !sound) return std::nullopt;
  return m;
}

std::optional<FrameHead> decode_frame_head(std::span<const uint8_t> first_bytes) {
  if (first_bytes.size() < kFingerprintSize) return std::nullopt;
  const auto before = bytes_before_arrays(kFrameLayout, first_bytes.subspan(kFingerprintSize));
  if (!before) return std::nullopt;
  const size_t head_size = kFingerprintSize + *before;
  const auto big_endian = [&](size_t at) {
    uint32_t n = 0;
    for (size_t i = 0; i < 4; ++i) n = n << 8 | first_bytes[at + i];
    return size_t{n};
  };
  const size_t arrays = big_endian(head_size - 8) + big_endian(head_size - 4);
  // The generated decoder sees the same message with both arrays empty.
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

mesh_t wire_of(const MeshMessage& m) {
  mesh_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.pulse = m.pulse;
  w.t_edge_ns = to_ns(m.pulse_edge);
  w.silhouette_iou = m.silhouette_iou;
  w.coverage = m.coverage;
  w.cameras = m.cameras;
  w.n_missing = static_cast<int32_t>(m.missing.size());
  w.missing = m.missing;
  w.compact = m.compact;
  w.n_compact = static_cast<int32_t>(w.compact.size());
  return w;
}

std::optional<MeshMessage> mesh_of(mesh_t&& w) {
  const auto sent = instant_of(w.utime);
  if (!sent || w.seq < 0 || w.pulse < 0) return std::nullopt;
  const auto is_part = [](double value) { return value >= 0 && value <= 1; };
  if (!is_part(w.silhouette_iou) || !is_part(w.coverage) || w.cameras < 0) return std::nullopt;
  return MeshMessage{.sent = *sent,
                     .seq = w.seq,
                     .take = std::move(w.take),
                     .pulse = w.pulse,
                     .pulse_edge = from_ns<Realtime>(w.t_edge_ns),
                     .silhouette_iou = w.silhouette_iou,
                     .coverage = w.coverage,
                     .cameras = w.cameras,
                     .missing = std::move(w.missing),
                     .compact = std::move(w.compact)};
}

}  // namespace

Bytes encode(const MeshMessage& m) { return pack(wire_of(m)); }

template <>
std::optional<MeshMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<mesh_t>(kMeshLayout, bytes);
  if (!w) return std::nullopt;
  return mesh_of(*std::move(w));
}

Bytes encode(const ShardMeshMessage& m) {
  shard_mesh_t w;
  w.mesh = wire_of(m);
  w.node = m.node;
  return pack(w);
}

template <>
std::optional<ShardMeshMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<shard_mesh_t>(kShardMeshLayout, bytes);
  if (!w) return std::nullopt;
  auto mesh = mesh_of(std::move(w->mesh));
  if (!mesh) return std::nullopt;
  ShardMeshMessage message;
  static_cast<MeshMessage&>(message) = *std::move(mesh);
  message.node = std::move(w->node);
  return message;
}

Bytes encode(const ShardMessage& m) {
  shard_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.node = m.node;
  w.first = m.first;
  w.done = m.done;
  w.ordered = m.ordered;
  w.shown = m.shown;
  w.given_up = m.given_up;
  w.n_given_up = static_cast<int32_t>(w.given_up.size());
  return pack(w);
}

template <>
std::optional<ShardMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<shard_t>(kShardLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const bool sane =
      w->seq >= 0 && std::min({w->first, w->done, w->ordered, w->shown}) >= -1 &&
      std::all_of(w->given_up.begin(), w->given_up.end(), [](int64_t pulse) { return pulse >= 0; });
  if (!sent || !sane) return std::nullopt;
  return ShardMessage{.sent = *sent,
                      .seq = w->seq,
                      .take = std::move(w->take),
                      .node = std::move(w->node),
                      .first = w->first,
                      .done = w->done,
                      .ordered = w->ordered,
                      .shown = w->shown,
                      .given_up = std::move(w->given_up)};
}

Bytes encode(const CommandMessage& m) {
  command_t w;
  w.utime = utime_of(m.sent);
  w.sender = m.sender;
  w.counter = m.counter;
  w.verb = static_cast<int8_t>(m.verb);
  w.own_only = m.own_only;
  w.take = m.take;
  w.rate_hz = m.rate_hz;
  w.pulses = m.pulses;
  w.n_allow_missing = static_cast<int32_t>(m.allow_missing.size());
  w.allow_missing = m.allow_missing;
  w.n_to = static_cast<int32_t>(m.to.size());
  w.to = m.to;
  std::fill(std::begin(w.mac), std::end(w.mac), uint8_t{0});
  return pack(w);
}

template <>
std::optional<CommandMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<command_t>(kCommandLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto verb = enumerator(w->verb, CommandVerb::kCheck);
  const bool sane = w->counter >= 0 && w->pulses >= 0 && std::isfinite(w->rate_hz) &&
                    w->rate_hz >= 0 && !w->sender.empty();
  if (!sent || !verb || !sane) return std::nullopt;
  return CommandMessage{.sent = *sent,
                        .sender = w->sender,
                        .counter = w->counter,
                        .verb = *verb,
                        .own_only = w->own_only != 0,
                        .take = w->take,
                        .rate_hz = w->rate_hz,
                        .pulses = w->pulses,
                        .allow_missing = std::move(w->allow_missing),
                        .to = std::move(w->to)};
}

Bytes encode(const ReplyMessage& m) {
  reply_t w;
  w.utime = utime_of(m.sent);
  w.node = m.node;
  w.command_sender = m.command_sender;
  w.command_counter = m.command_counter;
  w.outcome = static_cast<int8_t>(m.outcome);
  w.take = m.take;
  w.text = m.text;
  w.detail = m.detail;
  std::fill(std::begin(w.mac), std::end(w.mac), uint8_t{0});
  return pack(w);
}

template <>
std::optional<ReplyMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<reply_t>(kReplyLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto outcome = enumerator(w->outcome, ReplyMessage::Outcome::kRefused);
  if (!sent || !outcome || w->command_counter < 0) return std::nullopt;
  return ReplyMessage{.sent = *sent,
                      .node = w->node,
                      .command_sender = w->command_sender,
                      .command_counter = w->command_counter,
                      .outcome = *outcome,
                      .take = std::move(w->take),
                      .text = std::move(w->text),
                      .detail = std::move(w->detail)};
}

Bytes encode(const HealthMessage& m) {
  health_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.node = m.node;
  w.program = m.program;
  w.version = m.version;
  w.state = static_cast<int8_t>(m.state);
  w.take = m.take;
  w.text = m.text;
  w.n_values = static_cast<int32_t>(m.values.size());
  for (const auto& [value_name, value] : m.values) {
    w.names.push_back(value_name);
    w.values.push_back(value);
  }
  return pack(w);
}

template <>
std::optional<HealthMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<health_t>(kHealthLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto state = enumerator(w->state, NodeState::kFault);
  if (!sent || !state || w->seq < 0) return std::nullopt;
  HealthMessage m{.sent = *sent,
                  .seq = w->seq,
                  .node = w->node,
                  .program = w->program,
                  .version = w->version,
                  .state = *state,
                  .take = w->take,
                  .text = std::move(w->text),
                  .values = {}};
  for (size_t i = 0; i < w->names.size(); ++i) m.values[w->names[i]] = w->values[i];
  return m;
}

Bytes encode(const EventMessage& m) {
  event_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.node = m.node;
  w.severity = static_cast<int8_t>(m.severity);
  w.subject = m.subject;
  w.text = m.text;
  return pack(w);
}

template <>
std::optional<EventMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<event_t>(kEventLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto severity = enumerator(w->severity, Severity::kAlarm);
  if (!sent || !severity || w->seq < 0) return std::nullopt;
  return EventMessage{.sent = *sent,
                      .seq = w->seq,
                      .node = w->node,
                      .severity = *severity,
                      .subject = w->subject,
                      .text = std::move(w->text)};
}

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
  const bool right = w->has_mask ? m.mask.has_value() : w->n_runs == 0;
  if (!right) return std::nullopt;
  return m;
}

}  // namespace v3d
