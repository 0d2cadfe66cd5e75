// What all parts of the codec share: generated types to bytes and back, instants, enumerators. For
// wire/codec_*.cc only, which alone see the types generated from lcmtypes/.
#pragma once

#include <optional>
#include <span>

#include "base/core/check.h"
#include "base/core/time.h"
#include "wire/codec.h"
#include "wire/layout.h"

namespace v3d {

inline constexpr size_t kFingerprintSize = 8;

inline int64_t utime_of(RealtimeInstant t) { return to_ns(t) / 1000; }

/// Hostile times stay inside what nanoseconds can count.
inline std::optional<RealtimeInstant> instant_of(int64_t utime) {
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
  V3D_CHECK(used >= 0);
  bytes.resize(static_cast<size_t>(used));
  return bytes;
}

/// Empty when `bytes` are not exactly one such message. `layout`: as in lcmtypes/; the round trip
/// of every message type fails when it is wrong.
template <class Wire>
std::optional<Wire> unpack(Layout layout, std::span<const uint8_t> bytes) {
  if (bytes.size() < kFingerprintSize || bytes.size() > INT32_MAX) return std::nullopt;
  if (!fits(layout, bytes.subspan(kFingerprintSize))) return std::nullopt;
  Wire wire;
  const int size = static_cast<int>(bytes.size());
  if (wire.decode(bytes.data(), 0, size) != size) return std::nullopt;
  return wire;
}

/// For enumerators that count from 1.
template <class Enum>
std::optional<Enum> enumerator(int8_t value, Enum last) {
  if (value < 1 || value > static_cast<int8_t>(last)) return std::nullopt;
  return static_cast<Enum>(value);
}

}  // namespace v3d
