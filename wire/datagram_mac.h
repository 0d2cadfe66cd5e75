// The MAC of a datagram: who has the studio key made this fragment of this message, and nobody has
// changed it since. With studio_key, the adapter of libsodium.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "base/core/time.h"
#include "wire/studio_key.h"

namespace v3d {

inline constexpr size_t kMacTrailerSize = 32;

/// Stands behind the data of every authenticated datagram: magic "V3D1" (4 bytes), session (4),
/// `sent` in microseconds since 1970 (8), tag (16); integers are big-endian.
struct MacTrailer {
  uint32_t session = 0;    ///< drawn at random by each sending socket
  RealtimeInstant sent{};  ///< of the message, by the sender's clock; whole microseconds
  std::array<uint8_t, 16> tag{};

  std::array<uint8_t, kMacTrailerSize> bytes() const;
};

/// Empty when `bytes` do not begin with the magic, or `sent` lies before 1970 or after 2262.
std::optional<MacTrailer> read_trailer(std::span<const uint8_t, kMacTrailerSize> bytes);

/// A session number for a sending socket, from the kernel's random numbers.
uint32_t random_session();

/// Poly1305 with a key of its own for every datagram: keyed BLAKE2b of the datagram's head (header
/// and channel) and of the trailer without its tag. So the tag binds the header's fields, the
/// channel, the session, the time and the data with its length. Fragments after the first carry no
/// channel; they are bound to it by session and sequence number, which no sender uses twice with
/// one `sent`. Verification reads each byte once: three times as fast as BLAKE2b and ten times as
/// fast as HMAC-SHA-512-256 (docs/security.md). Any thread.
/// Source: Bernstein, "The Poly1305-AES message-authentication code", 2005; RFC 8439, 2.6.
class DatagramMac {
 public:
  explicit DatagramMac(const StudioKey& key);

  /// Fills in the tag.
  void sign(std::span<const uint8_t> head, std::span<const uint8_t> data,
            MacTrailer& trailer) const;
  /// Takes the same time whatever is wrong with the tag.
  bool verify(std::span<const uint8_t> head, std::span<const uint8_t> data,
              const MacTrailer& trailer) const;

 private:
  const SecretBuffer key_;
};

}  // namespace v3d
