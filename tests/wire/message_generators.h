// Random valid messages of all types, for property tests.
#pragma once

#include <rapidcheck.h>

#include "wire/messages.h"

namespace v3d::test {

inline std::string any_text() {
  return *rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127));
}

inline RealtimeInstant any_sent() {
  return from_ns<Realtime>(1000 * *rc::gen::inRange<int64_t>(0, int64_t{1} << 52));
}

inline int64_t any_count() { return *rc::gen::inRange<int64_t>(0, INT64_MAX); }

inline Mask any_mask(ImageSize size) {
  Mask mask(size);
  for (int y = 0; y < size.height; ++y) {
    const int begin = *rc::gen::inRange(0, size.width + 1);
    mask.fill_row(y, begin, *rc::gen::inRange(begin, size.width + 1));
  }
  return mask;
}

inline Frame any_frame() {
  Frame frame;
  frame.camera = any_text();
  frame.label = {.pulse = *rc::gen::inRange<int64_t>(-1, INT64_MAX),
                 .suspect = *rc::gen::arbitrary<bool>(),
                 .camera_counter = *rc::gen::arbitrary<uint64_t>(),
                 .device_time = from_ns<DeviceClock>(*rc::gen::arbitrary<int64_t>()),
                 .received = from_ns<Realtime>(*rc::gen::arbitrary<int64_t>())};
  frame.sensor_size = {*rc::gen::inRange(1, 80), *rc::gen::inRange(1, 20)};
  if (*rc::gen::arbitrary<bool>()) frame.mask = any_mask(frame.sensor_size);
  frame.roi.x0 = 2 * *rc::gen::inRange(0, frame.sensor_size.width / 2 + 1);
  frame.roi.y0 = 2 * *rc::gen::inRange(0, frame.sensor_size.height / 2 + 1);
  frame.roi.width = *rc::gen::inRange(0, frame.sensor_size.width - frame.roi.x0 + 1);
  frame.roi.height = *rc::gen::inRange(0, frame.sensor_size.height - frame.roi.y0 + 1);
  const auto format = *rc::gen::element(PixelFormat::kMono8, PixelFormat::kBayerRG8,
                                        PixelFormat::kBayerGB8, PixelFormat::kRGB8);
  frame.image = Image({frame.roi.width, frame.roi.height}, format);
  for (uint8_t& byte : frame.image.bytes) byte = *rc::gen::arbitrary<uint8_t>();
  return frame;
}

template <class M>
M any_message();

template <>
inline wire::PulseMessage any_message() {
  return {.sent = any_sent(),
          .seq = any_count(),
          .take = any_text(),
          .pulse = any_count(),
          .edge = from_ns<Realtime>(*rc::gen::arbitrary<int64_t>()),
          .edge_monotonic = from_ns<Monotonic>(*rc::gen::arbitrary<int64_t>())};
}

template <>
inline wire::FrameMessage any_message() {
  return {.sent = any_sent(), .seq = any_count(), .take = any_text(), .frame = any_frame()};
}

template <>
inline wire::MeshMessage any_message() {
  return {.sent = any_sent(),
          .seq = any_count(),
          .take = any_text(),
          .pulse = any_count(),
          .pulse_edge = from_ns<Realtime>(*rc::gen::arbitrary<int64_t>()),
          .silhouette_iou = *rc::gen::inRange(0, 101) * 0.01,
          .coverage = *rc::gen::inRange(0, 101) * 0.01,
          .cameras = *rc::gen::inRange(0, 100),
          .missing = {any_text(), any_text()},
          .compact = *rc::gen::arbitrary<std::vector<uint8_t>>()};
}

template <>
inline wire::ShardMeshMessage any_message() {
  wire::ShardMeshMessage message;
  static_cast<wire::MeshMessage&>(message) = any_message<wire::MeshMessage>();
  message.node = any_text();
  return message;
}

template <>
inline wire::ShardMessage any_message() {
  const auto pulse = [] { return *rc::gen::inRange<int64_t>(-1, INT64_MAX); };
  return {.sent = any_sent(),
          .seq = any_count(),
          .take = any_text(),
          .node = any_text(),
          .first = pulse(),
          .done = pulse(),
          .ordered = pulse(),
          .shown = pulse(),
          .given_up = {any_count(), any_count()}};
}

template <>
inline wire::SessionMessage any_message() {
  return {.sent = any_sent(),
          .session = *rc::gen::arbitrary<uint32_t>(),
          .newest = *rc::gen::arbitrary<uint32_t>(),
          .nonce = 1 + any_count() / 2,
          .is_answer = *rc::gen::arbitrary<bool>()};
}

template <>
inline wire::FrameKeyMessage any_message() {
  wire::FrameKeyMessage message{
      .sent = any_sent(),
      .session = *rc::gen::arbitrary<uint32_t>(),
      .newest = *rc::gen::arbitrary<uint32_t>(),
      .keys = std::vector<wire::SealedFrameKey>(*rc::gen::inRange<size_t>(0, 4))};
  for (wire::SealedFrameKey& key : message.keys) {
    for (uint8_t& byte : key.recipient) byte = *rc::gen::arbitrary<uint8_t>();
    for (uint8_t& byte : key.sealed) byte = *rc::gen::arbitrary<uint8_t>();
  }
  return message;
}

template <>
inline wire::CommandMessage any_message() {
  return {.sent = any_sent(),
          .sender = "v3dctl" + any_text(),
          .counter = any_count(),
          .verb = static_cast<wire::CommandVerb>(*rc::gen::inRange(1, 8)),
          .own_only = *rc::gen::arbitrary<bool>(),
          .take = any_text(),
          .rate_hz = *rc::gen::inRange(0, 1000) / 8.0,
          .pulses = any_count(),
          .allow_missing = {any_text()},
          .to = {any_text(), any_text()},
          .nonces = {any_count(), any_count()}};
}

template <>
inline wire::ReplyMessage any_message() {
  return {.sent = any_sent(),
          .node = any_text(),
          .command_sender = any_text(),
          .command_counter = any_count(),
          .command_sent = any_sent(),
          .nonce = any_count(),
          .outcome = static_cast<wire::ReplyMessage::Outcome>(*rc::gen::inRange(1, 5)),
          .take = any_text(),
          .text = any_text(),
          .detail = any_text()};
}

template <>
inline wire::HealthMessage any_message() {
  return {.sent = any_sent(),
          .seq = any_count(),
          .node = any_text(),
          .program = any_text(),
          .version = any_text(),
          .state = static_cast<wire::NodeState>(*rc::gen::inRange(1, 6)),
          .take = any_text(),
          .text = any_text(),
          .values = {{any_text(), 0.25}, {"frames_received", *rc::gen::inRange(0, 1000) * 1.0}},
          .texts = {{any_text(), any_text()}}};
}

template <>
inline wire::EventMessage any_message() {
  return {.sent = any_sent(),
          .seq = any_count(),
          .node = any_text(),
          .severity = static_cast<wire::Severity>(*rc::gen::inRange(1, 4)),
          .subject = any_text(),
          .text = any_text()};
}

template <>
inline wire::PreviewMessage any_message() {
  const ImageSize size{*rc::gen::inRange(1, 80), *rc::gen::inRange(1, 20)};
  wire::PreviewMessage message{.sent = any_sent(),
                               .seq = any_count(),
                               .camera = any_text(),
                               .pulse = *rc::gen::inRange<int64_t>(-1, INT64_MAX),
                               .size = size,
                               .mask = {},
                               .jpeg = *rc::gen::arbitrary<std::vector<uint8_t>>()};
  if (*rc::gen::arbitrary<bool>()) message.mask = any_mask(size);
  return message;
}

}  // namespace v3d::test
