// Message authentication code (MAC) of a datagram. It proves that a holder of the key made this
// fragment of this message, and that it was not changed. The key is the studio key, or for live
// frames of a studio with a member list a frame key (wire/frame_key.h). Adapter of libsodium.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "base/core/time.h"
#include "wire/studio_key.h"

namespace v3d {

inline constexpr size_t kMacTrailerSize = 32;

/// Follows the data of every authenticated datagram: magic "V3D1" (4 bytes), session (4), `sent` in
/// microseconds since 1970 (8), tag (16). Integers are big-endian.
struct MacTrailer {
  uint32_t session = 0;    ///< random number of the sending socket
  RealtimeInstant sent{};  ///< time of the message on the sender's clock; whole microseconds
  std::array<uint8_t, 16> tag{};

  std::array<uint8_t, kMacTrailerSize> bytes() const;
};

/// Empty when `bytes` do not start with the magic, or when `sent` is before 1970 or after 2262.
std::optional<MacTrailer> read_trailer(std::span<const uint8_t, kMacTrailerSize> bytes);

/// Returns a random session number for a sending socket, from the random generator of the kernel.
uint32_t random_session();

/// Poly1305 MAC with a separate key for every datagram.
///
/// The key is the keyed BLAKE2b hash of the datagram's head (header and channel) and of the trailer
/// without its tag. So the tag authenticates header, channel, session, time, data and length of the
/// data. Fragments after the first have no channel. Session and sequence number bind them to it,
/// and no sender uses these twice with the same `sent`.
///
/// Verification reads each byte once. It is three times as fast as BLAKE2b and ten times as fast as
/// HMAC-SHA-512-256 (docs/security.md). Any thread.
/// Source: Bernstein, "The Poly1305-AES message-authentication code", 2005; RFC 8439, 2.6.
class DatagramMac {
 public:
  explicit DatagramMac(const StudioKey& key);
  /// `key`: 32 bytes that were derived for this purpose alone.
  explicit DatagramMac(SecretBuffer key) : key_(std::move(key)) {}

  /// Sets the tag of `trailer`.
  void sign(std::span<const uint8_t> head, std::span<const uint8_t> data,
            MacTrailer& trailer) const;
  /// Returns whether the tag is right, in constant time.
  bool verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
              const MacTrailer& trailer) const;

 private:
  SecretBuffer key_;
};

}  // namespace v3d
