// Codec of the LCM messages: encodes messages to bytes, decodes bytes to messages.
//
// Only codec_*.cc, which implement it, include the types generated from lcmtypes/. Decoders treat
// all bytes as hostile and return nothing if any rule is broken. Rules: fingerprint, lengths (no
// truncation, no trailing bytes, nothing negative), ranges of enumerations, sizes of masks and
// images, and the checksum of a frame.
//
// Decoders never throw. They allocate at most a small multiple of the size of the input. A mask,
// which is sent as run lengths, needs one bit for each pixel: at most kMaxImageSide squared bits.
//
// `sent` travels in whole microseconds (the LCM convention for `utime`), all other instants in
// nanoseconds.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "wire/messages.h"

namespace v3d::wire {

using Bytes = std::vector<uint8_t>;

Bytes encode(const PulseMessage& message);
Bytes encode(const FrameMessage& message);
Bytes encode(const MeshMessage& message);
/// The last field of commands and replies is reserved for the MAC (wire/secret_keys.h) and is zero
/// here.
Bytes encode(const CommandMessage& message);
Bytes encode(const ReplyMessage& message);
Bytes encode(const HealthMessage& message);
Bytes encode(const EventMessage& message);
Bytes encode(const PreviewMessage& message);
Bytes encode(const SessionMessage& message);
Bytes encode(const FrameKeyMessage& message);
Bytes encode(const ShardMessage& message);
Bytes encode(const ShardMeshMessage& message);

/// The part of an encoded FrameMessage before its pixels, with the checksum of the whole message.
/// The rest of the message is `message.frame.image.bytes`. Writers use it to avoid a copy of the
/// pixels.
Bytes encode_head(const FrameMessage& message);

/// The message, or nothing when `bytes` break a rule above. M is one of the message types.
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
std::optional<FrameKeyMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<ShardMessage> decode(std::span<const uint8_t> bytes);
template <>
std::optional<ShardMeshMessage> decode(std::span<const uint8_t> bytes);

/// The fields of a frame message before its pixels. They are sufficient to index a log without
/// reading the pixels.
struct FrameHead {
  std::string take;
  std::string camera;
  FrameLabel label;
  size_t message_size = 0;  ///< of the whole message, bytes
};

/// Decodes the first bytes of an encoded FrameMessage; kFrameHeadSize bytes are sufficient. Returns
/// nothing when the bytes are too few or break a rule. Does not check the checksum.
std::optional<FrameHead> decode_frame_head(std::span<const uint8_t> first_bytes);
inline constexpr size_t kFrameHeadSize = 1024;

}  // namespace v3d::wire
