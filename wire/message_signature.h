// The signature of one member of a studio behind an encoded message.
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

/// The first bytes of a public key: which key to verify with.
using KeyId = std::array<uint8_t, 8>;
KeyId id_of(const PublicKey& key);
/// Which key has signed. Empty: no signature is required, or the key is not known.
using Signer = std::optional<KeyId>;

/// Stands behind the message, and before the trailers of its datagrams: magic "V3DS" (4 bytes), key
/// id (8), signature (64) of all bytes before it. LCM's own tools ignore what follows a message.
inline constexpr size_t kMessageSignatureSize = 4 + std::tuple_size_v<KeyId> + kSignatureSize;

/// A received message and its signature; views of the received bytes.
struct SignedMessage {
  std::span<const uint8_t> message;
  std::span<const uint8_t> signed_bytes;  ///< message, magic and key id
  KeyId key_id{};
  Signature signature{};

  bool is_signed_by(const PublicKey& key) const;
};

/// Appends the signature. The first bytes of a message are its type, so the signature of a message
/// of one type is none for another type.
Bytes sign_message(Bytes message, const SigningKey& key);
/// Verifies nothing. Empty when no signature follows a message.
std::optional<SignedMessage> split_signature(std::span<const uint8_t> bytes);

/// Channel, session, number and time of a message, as the trailers of its datagrams have them
/// (wire/datagram_mac.h).
struct MessageOrigin {
  std::string_view channel;
  uint32_t session = 0;
  uint32_t sequence = 0;   ///< of the message in its session
  RealtimeInstant sent{};  ///< whole microseconds count
};

/// What a member signs of every message but commands and replies: the text "V3D message on the bus,
/// version 1" with a newline, then the BLAKE2b-256 (LeafHash) of channel, zero byte, session (4
/// bytes), sequence (4), `sent` in microseconds (8, all big-endian), message, magic and key id. So
/// a signature is valid on one channel, for one message of one session. No other member can send a
/// recorded message again. No command, reply, take or member list begins with this text. Ed25519
/// reads a message twice to sign it; BLAKE2b reads it once.
inline constexpr std::string_view kBusText = "V3D message on the bus, version 1\n";
using BusStatement = std::array<uint8_t, kBusText.size() + 32>;
/// `signed_bytes`: message, magic and key id.
BusStatement bus_statement(std::span<const uint8_t> signed_bytes, const MessageOrigin& origin);
/// The message with its signature, in the layout above.
Bytes sign_on_bus(std::span<const uint8_t> message, const MessageOrigin& origin,
                  const SigningKey& key);

}  // namespace v3d
