// Checks and conversion of the generated LCM types.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "base/core/error.h"
#include "base/core/time.h"
#include "wire/codec.h"

namespace v3d::wire {

// Check of the lengths in an LCM message before the generated decoder runs. That decoder resizes
// its vectors to any length in a message before it checks that the bytes exist.

/// The fields of a message type in order, one letter each:
///   q 8 bytes   i 4 bytes   b 1 byte   ? boolean   s string   n int32 count of an array below
///   m 32 bytes
///   B bytes[count]   S strings[count]   D 8-byte numbers[count]
/// A digit after an array selects its count: its position among the n's, from 0. Examples: "B0",
/// "S1".
using Layout = std::string_view;

/// True when `body` (the bytes after the 8-byte fingerprint) is exactly one such message. Every
/// length is at least 0 and inside the body, every string ends with its only NUL, and every boolean
/// is 0 or 1. No bytes are left over.
bool fits(Layout layout, std::span<const uint8_t> body);

/// The number of bytes from the start of `body` to the first byte array (letter B), by the same
/// rules. Empty when the bytes before it are invalid or incomplete.
std::optional<size_t> bytes_before_arrays(Layout layout, std::span<const uint8_t> body);

// Shared parts of the codec: conversion of generated types to bytes and back, of instants and of
// enumerators. Only wire/codec_*.cc, which use the types generated from lcmtypes/, include this
// header.

inline constexpr size_t kFingerprintSize = 8;

inline int64_t utime_of(RealtimeInstant t) { return to_ns(t) / 1000; }

/// Empty when nanoseconds of 64 bits cannot represent the time.
inline std::optional<RealtimeInstant> instant_of(int64_t utime) {
  constexpr int64_t kLimit = INT64_MAX / 1000;
  if (utime < -kLimit || utime > kLimit) return std::nullopt;
  return from_ns<Realtime>(utime * 1000);
}

/// Encodes `wire`. `room`: number of bytes to reserve for the caller to append.
template <class Wire>
Bytes pack(const Wire& wire, size_t room = 0) {
  const auto size = static_cast<size_t>(wire.getEncodedSize());
  Bytes bytes;
  bytes.reserve(size + room);
  bytes.resize(size);
  const int used = wire.encode(bytes.data(), 0, static_cast<int>(size));
  V3D_CHECK(used >= 0);
  bytes.resize(static_cast<size_t>(used));
  return bytes;
}

/// Decodes `bytes`. Empty when they are not exactly one message of this type. `layout` must match
/// the type in lcmtypes/; otherwise the round-trip test of the type fails.
template <class Wire>
std::optional<Wire> unpack(Layout layout, std::span<const uint8_t> bytes) {
  if (bytes.size() < kFingerprintSize || bytes.size() > INT32_MAX) return std::nullopt;
  if (!fits(layout, bytes.subspan(kFingerprintSize))) return std::nullopt;
  Wire wire;
  const int size = static_cast<int>(bytes.size());
  if (wire.decode(bytes.data(), 0, size) != size) return std::nullopt;
  return wire;
}

/// Converts a number to an enumerator. Requires enumerators that count from 1. Empty out of range.
template <class Enum>
std::optional<Enum> enumerator(int8_t value, Enum last) {
  if (value < 1 || value > static_cast<int8_t>(last)) return std::nullopt;
  return static_cast<Enum>(value);
}

}  // namespace v3d::wire
