// Ed25519 signature that one member of a studio appends to an encoded message.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>

#include "base/core/time.h"
#include "wire/codec.h"
#include "wire/signing_key.h"

namespace v3d {

/// The first bytes of a public key. They identify the key to verify with.
using KeyId = std::array<uint8_t, 8>;
KeyId id_of(const PublicKey& key);
/// The key that signed. Empty: no signature is required, or the key is unknown.
using Signer = std::optional<KeyId>;

/// Size of the signature block, bytes. It follows the message and precedes the trailers of its
/// datagrams: magic "V3DS" (4 bytes), key id (8), signature (64) of all bytes before it. The tools
/// of LCM ignore bytes after a message.
inline constexpr size_t kMessageSignatureSize = 4 + std::tuple_size_v<KeyId> + kSignatureSize;

/// A received message and its signature; views of the received bytes.
struct SignedMessage {
  std::span<const uint8_t> message;
  std::span<const uint8_t> signed_bytes;  ///< message, magic and key id
  KeyId key_id{};
  Signature signature{};

  bool is_signed_by(const PublicKey& key) const;
};

/// Appends the signature. A message starts with its type, so a signature is not valid for a message
/// of another type.
Bytes sign_message(Bytes message, const SigningKey& key);
/// Splits message and signature without verifying it. Empty when no signature follows a message.
std::optional<SignedMessage> split_signature(std::span<const uint8_t> bytes);

/// Channel, session, sequence number and time of a message, as in the trailers of its datagrams
/// (wire/datagram_mac.h).
struct MessageOrigin {
  std::string_view channel;
  uint32_t session = 0;
  uint32_t sequence = 0;   ///< number of the message in its session
  RealtimeInstant sent{};  ///< only whole microseconds are used
};

/// Bytes that a member signs for every message except commands and replies.
///
/// They are the text "V3D message on the bus, version 1" with a newline, then a BLAKE2b-256 hash
/// (LeafHash). The hash covers channel, zero byte, session (4 bytes), sequence (4), `sent` in
/// microseconds (8), message, magic and key id. Integers are big-endian.
///
/// So a signature is valid on one channel, for one message of one session. No other member can send
/// a recorded message again. No command, reply, take or member list starts with this text. The hash
/// comes first because Ed25519 reads a message twice to sign it, and BLAKE2b reads it once.
inline constexpr std::string_view kBusText = "V3D message on the bus, version 1\n";
using BusStatement = std::array<uint8_t, kBusText.size() + 32>;
/// `signed_bytes`: message, magic and key id.
BusStatement bus_statement(std::span<const uint8_t> signed_bytes, const MessageOrigin& origin);
/// Returns the message with its signature, in the layout above.
Bytes sign_on_bus(std::span<const uint8_t> message, const MessageOrigin& origin,
                  const SigningKey& key);

}  // namespace v3d
