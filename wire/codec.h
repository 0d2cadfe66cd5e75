// Bytes to messages and back. Implemented by codec_*.cc, a file for what belongs together; they
// alone see the types generated from lcmtypes/. Decoders treat bytes as hostile: anything wrong
// (fingerprint, truncation, trailing bytes, negative or absurd lengths, values out of their
// enumeration, a mask or image that does not fit its size, a frame's checksum that is not its own)
// gives nothing. They never throw and never allocate more than a small multiple of the input (a
// mask, which is sent as runs: no more than its size says, at most kMaxImageSide squared bits).
//
// `sent` travels in whole microseconds (LCM's custom for `utime`), all other instants in
// nanoseconds.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d {

using Bytes = std::vector<uint8_t>;

Bytes encode(const PulseMessage& message);
Bytes encode(const FrameMessage& message);
Bytes encode(const MeshMessage& message);
/// With room for the seal (wire/studio_key.h) behind the two that have one.
Bytes encode(const CommandMessage& message);
Bytes encode(const ReplyMessage& message);
Bytes encode(const HealthMessage& message);
Bytes encode(const EventMessage& message);
Bytes encode(const PreviewMessage& message);
Bytes encode(const SessionMessage& message);
Bytes encode(const ShardMessage& message);
Bytes encode(const ShardMeshMessage& message);

/// An encoded FrameMessage up to its pixels, whose checksum it holds; `message.frame.image.bytes`
/// are the rest of it. For writers that need not copy the pixels.
Bytes encode_head(const FrameMessage& message);

/// M is one of the message types above.
template <class M>
std::optional<M> decode(std::span<const uint8_t> bytes);

template <>
std::optional<PulseMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<FrameMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<MeshMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<CommandMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<ReplyMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<HealthMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<EventMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<PreviewMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<SessionMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<ShardMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<ShardMeshMessage> decode(std::span<const uint8_t> bytes);

/// What a frame message says before its pixels: enough to index a log without reading it whole.
struct FrameHead {
  std::string take;
  std::string camera;
  FrameLabel label;
  size_t message_size = 0;  ///< of the whole message, bytes
};

/// From the first bytes of an encoded FrameMessage (kFrameHeadSize are enough).
std::optional<FrameHead> decode_frame_head(std::span<const uint8_t> first_bytes);
inline constexpr size_t kFrameHeadSize = 1024;

}  // namespace v3d
