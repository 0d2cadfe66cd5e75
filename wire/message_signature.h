// The signature of one member of a studio behind an encoded message.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>

#include "wire/codec.h"
#include "wire/signing_key.h"

namespace v3d {

/// The first bytes of a public key: which key to verify with.
using KeyId = std::array<uint8_t, 8>;
KeyId id_of(const PublicKey& key);

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

}  // namespace v3d
