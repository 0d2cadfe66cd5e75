// MACs of datagrams and the keys of live frames.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "base/core/time.h"
#include "wire/messages.h"
#include "wire/secret_keys.h"
#include "wire/signatures.h"

namespace v3d::wire {

// Message authentication code (MAC) of a datagram. It proves that a holder of the key made this
// fragment of this message, and that it was not changed. The key is the studio key, or for live
// frames of a studio with a member list a frame key. Adapter of libsodium.

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

// Frame key: secret with which a node authenticates its live frames when there is a member list.
// Adapter of libsodium.

/// A random secret of 256 bits. Its node draws it, and sends it sealed to the reconstruction nodes.
/// They verify the frames of this node with it; other holders of the studio key can neither forge
/// nor verify them. The secret is overwritten when the key is destroyed.
class FrameKey {
 public:
  /// Makes a new key from the random generator of the kernel.
  static FrameKey make();
  /// `secret`: 32 bytes.
  explicit FrameKey(SecretBuffer secret) : secret_(std::move(secret)) {}

  /// The key for the holder of the secret key of `recipient`, who alone can open it (sealed box of
  /// libsodium: X25519, XSalsa20, Poly1305). It does not state who sealed it: the message needs a
  /// signature. Empty when `recipient` is no point of Ed25519.
  std::optional<SealedFrameKey> seal_for(const PublicKey& recipient) const;
  /// Opens a sealed key. Empty when it was not sealed for `own`, or was changed.
  static std::optional<FrameKey> open(const SealedFrameKey& sealed, const SigningKey& own);

  /// The MAC of the node's frames. Its key is derived from this key alone: the replacement of the
  /// studio key does not change it.
  DatagramMac mac() const;

 private:
  SecretBuffer secret_;
};

}  // namespace v3d::wire
